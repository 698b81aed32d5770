"""A page in the browser that teaches a sensor and recalibrates it.

``hdc live --camera 0`` and ``hdc live --folder DIR`` open it for a camera or a recording,
``hdc live MODEL --camera 0`` (or ``--video FILE``) shows a model that was trained before, and
``python -m scenes.live`` opens a page of the simulated sensor, to be pressed. It needs
``pip install 'speckle-hdc[live]'``.

There is one sensor and one model, shared by all who open the page. One thread takes frames and
predicts (:mod:`hdc.live.worker`); :mod:`hdc.live.session` holds the model and the taught frames.
Nothing is written to disk: a model is saved by download.
"""

from __future__ import annotations

from hdc.live.sources import Source, Stream, open_source

__all__ = ["Source", "Stream", "open_source"]
