"""Pictures of the scene as a browser draws it, with what their colours mean; many of them as a film.

GIF, which Pillow writes and everything shows. It comes with viser; an MP4 needs ffmpeg, which nothing here does.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence

import numpy as np
import viser
from PIL import Image, ImageDraw, ImageFont

from twin.errors import DataError
from twin.figure import Range
from twin.viewer.colours import STOPS

WIDE, HIGH = 800, 600  # pixels of a film
RATE = 12.5  # pictures a second: GIF counts hundredths of a second, and browsers slow down what is under two
LONGEST = 600  # pictures: some 15 MB
PATIENCE = 20.0  # s for a browser to draw one
BAR, EDGE = (200, 10), 12  # pixels


def render(client: viser.ClientHandle, wide: int = WIDE, high: int = HIGH) -> Image.Image:
    """What a browser shows. Raises DataError where it is gone or draws nothing."""
    try:
        pixels = client.get_render(high, wide, timeout=PATIENCE)
    except (RuntimeError, TimeoutError) as error:
        raise DataError(f"no picture came from the browser ({error}); leave its window open and in front") from None
    return Image.fromarray(np.ascontiguousarray(pixels[..., :3]))


def captioned(picture: Image.Image, words: str, ranges: Sequence[Range]) -> Image.Image:
    """The picture with words above and its colour bars below, which a browser keeps beside the scene."""
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(13)
    draw.multiline_text((EDGE, EDGE), words, fill=(20, 20, 20), font=font)
    wide, high = BAR
    share = np.linspace(0.0, len(STOPS) - 1.0, wide)
    ramp = np.stack([np.interp(share, np.arange(len(STOPS)), c) for c in STOPS.T], axis=-1).astype(np.uint8)
    strip = Image.fromarray(np.repeat(ramp[None], high, axis=0))
    for k, over in enumerate(ranges):
        top = picture.height - EDGE - (len(ranges) - k) * 46
        draw.text((EDGE, top), f"{over.name}, {over.unit}", fill=(20, 20, 20), font=font)
        picture.paste(strip, (EDGE, top + 17))
        draw.text((EDGE, top + 28), f"{over.low:.3g}", fill=(20, 20, 20), font=font)
        draw.text((EDGE + wide, top + 28), f"{over.high:.3g}", fill=(20, 20, 20), font=font, anchor="ra")
    return picture


def plain(words: str) -> str:
    """Markdown without its marks."""
    return re.sub(r"\*\*|  $", "", words, flags=re.MULTILINE)


def png(picture: Image.Image) -> bytes:
    out = io.BytesIO()
    picture.save(out, "PNG")
    return out.getvalue()


class Film:
    """A replay of a trial from its first to its last instant, being taken."""

    def __init__(self, client: viser.ClientHandle, end: float, speed: float) -> None:
        """Of a trial that ends at `end` (s), `speed` times as fast. Raises DataError for one of too many pictures."""
        self.client, self._step, self.end = client, speed / RATE, end
        self.length = int(end / self._step) + 1
        if self.length > LONGEST:
            least = end * RATE / (LONGEST - 1)
            raise DataError(f"a film of {self.length} pictures, {LONGEST} are the most: set the speed to {least:.1f} or more")
        self._pictures: list[Image.Image] = []

    @property
    def time(self) -> float:
        """s of the trial, of the next picture."""
        return min(len(self._pictures) * self._step, self.end)

    @property
    def done(self) -> bool:
        return len(self._pictures) == self.length

    def take(self, words: str, ranges: Sequence[Range]) -> None:
        """One picture of what is drawn. Raises DataError where none comes."""
        picture = captioned(render(self.client), words, ranges)
        self._pictures.append(picture.quantize(256, dither=Image.Dither.NONE))

    def gif(self) -> bytes:
        out, (first, *others) = io.BytesIO(), self._pictures
        first.save(out, "GIF", save_all=True, append_images=others, duration=round(1e3 / RATE), loop=0)
        return out.getvalue()
