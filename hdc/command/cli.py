"""The command ``hdc``, which has a command for each thing to do, a file each.

torch takes seconds to import, so it is imported when the first frame is learnt or asked about.
"""

from __future__ import annotations

import click

import hdc
from hdc.command.compare.command import compare
from hdc.command.export import export
from hdc.command.live import live
from hdc.command.look import look
from hdc.command.recalibrate import recalibrate
from hdc.command.sample import sample
from hdc.command.train import train
from hdc.command.use import evaluate, info, predict

cli = click.Group(
    "hdc",
    commands=[
        look,
        train,
        compare,
        predict,
        evaluate,
        recalibrate,
        export,
        live,
        info,
        sample,
    ],
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    help="""Train a hyperdimensional classifier of images, and use it.

    A RECORDING is one of these; hdc look RECORDING shows how it is read.

    \b
    a folder         images in a sub-folder per class, or as a manifest.csv
                     (file, label), a --template or --values say; or a video
                     or a file of arrays for each recording, by a --template
    .npz, .mat, .h5  frames [N, H, W] or [N, D] with labels or values [N]
    .tif, .npy       frames, with a CSV of labels beside it
    .csv             a row of numbers and a label per frame
    a video          with a CSV of intervals (start_s, end_s, label) beside it
    """,
)
click.version_option(hdc.__version__, prog_name="hdc", message="%(prog)s %(version)s")(
    cli
)
