//! Tells the binding which revision it is built from, so that results can say what computed them.

use std::process::Command;

/// What git prints, trimmed; `None` without git or outside a checkout, as in a source distribution.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn main() {
    // The sources whose changes matter, and the file that every commit and checkout touches.
    println!("cargo:rerun-if-changed=..");
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo:rerun-if-changed={log}");
    }
    // An untracked folder inside someone else's repository is no checkout of sandboil.
    let is_tracked = git(&["ls-files", "--error-unmatch", "build.rs"]).is_some();
    let revision = git(&["rev-parse", "HEAD"]).filter(|_| is_tracked).unwrap_or_default();
    let is_changed = git(&["status", "--porcelain", "--", ".."]).is_some_and(|changes| !changes.is_empty());
    let suffix = if is_changed && !revision.is_empty() { "+changes" } else { "" };
    println!("cargo:rustc-env=SANDBOIL_REVISION={revision}{suffix}");
}
