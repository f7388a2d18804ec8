"""Profiles: what an owner and a reader share beside the key, under a dated name.

A profile, once published, is never edited, so that old marks stay readable; golden marks in the tests hold it to that.
"""

from o3dmark.coding.payload import CODES
from o3dmark.methods import METHODS
from o3dmark.watermark import Watermark

PROFILES: dict[str, Watermark] = {
    "robust-2026": Watermark(METHODS.make("shape-spectrum"), CODES.make("random"), 64),
    "invisible-2026": Watermark(METHODS.make("shape-spectrum:mrms=0.00037"), CODES.make("random"), 64),
    "slender-2026": Watermark(METHODS.make("shape-spectrum:lowest=8,highest=24,rungs=60"), CODES.make("random"), 64),
    "paper-2026": Watermark(METHODS.make("saliency-scs"), CODES.make("random"), 64),
    "contested-2026": Watermark(
        METHODS.make("shape-spectrum:mrms=0.0004,lowest=8,highest=24,rungs=60"), CODES.make("random"), 64
    ),
    "layered-2026": Watermark(METHODS.make("layered"), CODES.make("random"), 64),
    "tiny-2026": Watermark(METHODS.make("saliency-scs"), CODES.make("random:message_bytes=1"), 32),
}
DEFAULT_PROFILE = "robust-2026"
ONE_LAYER = {name: profile for name, profile in PROFILES.items() if not profile.method.layers}
"""Where none of these holds a message, none of several layers does: its layer in the solid is the default's."""
