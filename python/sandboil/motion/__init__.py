"""Ground motions: files, integration, correction, intensity measures, response spectra and generators.

Theory and sources: docs/theory/motion.md.
"""

from ._motion import Kind, Motion
from ._spectrum import DEFAULT_PERIODS, ResponseSpectrum, response_spectrum

__all__ = ["DEFAULT_PERIODS", "Kind", "Motion", "ResponseSpectrum", "response_spectrum"]
