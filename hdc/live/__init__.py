"""A page in the browser on which a sensor is touched, taught, and recalibrated while it runs.

``hdc live --camera 0`` and ``hdc live --folder DIR`` open it for a camera or a recording;
``python -m scenes.live`` of the harness for the simulated sensor. It needs ``pip install
'hdc[live]'``.

There is one sensor and one model. A worker thread takes frames, asks the model and does what the
page wants done, one step a frame (:mod:`hdc.live.worker`, :mod:`hdc.live.session`); everybody who
opens the page sees the same frames and teaches the same model. Frames are made only while somebody
looks. Nothing is written to disk: a saved model is downloaded, a loaded one uploaded.
"""

from __future__ import annotations

from hdc.live.sources import Camera, Pressable, Recorded, Source, Touch

__all__ = ["Camera", "Pressable", "Recorded", "Source", "Touch"]
