"""Profiles of level ground for equivalent-linear analysis, and deconvolution of motions to their base.

Theory and sources: docs/theory/motion.md.
"""

from ._deconvolution import Deconvolution, DeconvolutionWarning, Place, deconvolution
from ._profile import CurveChoice, HalfSpace, ModulusCurve, SiteLayer, SiteProfile, darendeli, measured

__all__ = [
    "CurveChoice",
    "Deconvolution",
    "DeconvolutionWarning",
    "HalfSpace",
    "ModulusCurve",
    "Place",
    "SiteLayer",
    "SiteProfile",
    "darendeli",
    "deconvolution",
    "measured",
]
