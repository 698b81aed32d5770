"""``hdc compare`` and ``hdc train --choose``: which encoder and read-out suit frames of one's own.

:mod:`hdc.selection` chooses by cross-validation. :mod:`.frames` reads the frames and says which are
learnt and which are tested, :mod:`.choose` says what was chosen, :mod:`.rivals` are models of grey
values, :mod:`.judge` tests all on frames that no choice has seen, :mod:`.curve` learns from ever
more frames, :mod:`.cost` times them, within a :mod:`.budget`, :mod:`.dither` moves the test frames
by a grey level, :mod:`.advice` says what to do, :mod:`.show` prints it.
"""
