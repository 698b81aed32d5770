"""``hdc live``: a page that teaches or shows a model."""

from __future__ import annotations

from pathlib import Path

import click

from hdc.command import options, work
from hdc.command.source import pixels
from hdc.readers import Window


@click.command(short_help="Teach or watch a model in the browser.")
@click.argument("model", type=options.FILE, required=False)
@click.option(
    "--camera", type=click.IntRange(0), metavar="N", help="Number of the camera."
)
@click.option(
    "--folder", type=options.FILE, metavar="RECORDING", help="Play this back instead."
)
@click.option(
    "--video", type=options.FILE, metavar="FILE", help="Play this video instead."
)
@pixels
@click.option(
    "--host",
    metavar="ADDRESS",
    help="Listen at this address. [default: this computer alone]",
)
@click.option("--port", type=click.IntRange(1, 65535), default=8080)
def live(
    model: Path | None,
    camera: int | None,
    folder: Path | None,
    video: Path | None,
    window: Window,
    host: str | None,
    port: int,
) -> None:
    """Teach a model in the browser, or watch a MODEL that was trained.

    A page shows the frames of a camera, or of a RECORDING or a video played back, and what the
    model says. The crop and subsampling of a MODEL are used. A MODEL without them takes the given
    ones, such as a model of arrays that were thinned before.
    """
    if sum(given is not None for given in (camera, folder, video)) != 1:
        raise click.UsageError(
            "expected one of --camera N, --folder RECORDING and --video FILE"
        )
    from hdc.live import open_source
    from hdc.live.page import serve
    from hdc.live.session import Session

    trained = None
    if model is not None:
        trained, own = work.load(model)
        if not hasattr(trained, "classes_"):
            raise ValueError(f"{model}: expected a model of classes, found numbers")
        if Window() not in (own, window):
            wanted = "no --crop or --subsample with a MODEL that has its own"
            raise click.UsageError(f"expected {wanted}")
        window = window if own == Window() else own
    source = open_source(window, folder, video, camera or 0)
    if trained is not None:
        work.check_size(trained, source.shape, source.title)
    serve(Session(source, trained), host, port)
