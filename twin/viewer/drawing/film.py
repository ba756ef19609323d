"""Pictures of the scene as a browser draws it, with colour bars, and films of such pictures.

Films are GIF, which Pillow (installed with viser) writes; MP4 would need ffmpeg.
"""

import io
import re
from collections.abc import Sequence

import numpy as np
import viser
from PIL import Image, ImageDraw, ImageFont

from twin.body.drawable import ColourScale
from twin.foundation.errors import DataError
from twin.viewer.drawing.colours import VIRIDIS

FILM_WIDTH, FILM_HEIGHT = 800, 600  # pixels of a film
FILM_RATE = 12.5  # pictures a second; GIF counts hundredths of a second, and browsers slow down steps below two
MOST_PICTURES = 600  # of a film: some 15 MB
DRAWING_TIMEOUT = 20.0  # s for a browser to draw a picture
BAR_SIZE, CAPTION_MARGIN = (200, 10), 12  # pixels


def take_picture(client: viser.ClientHandle, wide: int = FILM_WIDTH, high: int = FILM_HEIGHT) -> Image.Image:
    """Return the picture that a browser shows. Raises DataError where the browser is gone or draws nothing."""
    try:
        pixels = client.get_render(high, wide, timeout=DRAWING_TIMEOUT)
    except (RuntimeError, TimeoutError) as error:
        raise DataError(f"no picture came from the browser ({error}); leave its window open and in front") from None
    return Image.fromarray(np.ascontiguousarray(pixels[..., :3]))


def add_caption(picture: Image.Image, words: str, ranges: Sequence[ColourScale]) -> Image.Image:
    """Write words above the picture and its colour bars below."""
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(13)
    draw.multiline_text((CAPTION_MARGIN, CAPTION_MARGIN), words, fill=(20, 20, 20), font=font)
    wide, high = BAR_SIZE
    share = np.linspace(0.0, len(VIRIDIS) - 1.0, wide)
    ramp = np.stack([np.interp(share, np.arange(len(VIRIDIS)), c) for c in VIRIDIS.T], axis=-1).astype(np.uint8)
    strip = Image.fromarray(np.repeat(ramp[None], high, axis=0))
    for k, over in enumerate(ranges):
        top = picture.height - CAPTION_MARGIN - (len(ranges) - k) * 46
        draw.text((CAPTION_MARGIN, top), f"{over.name}, {over.unit}", fill=(20, 20, 20), font=font)
        picture.paste(strip, (CAPTION_MARGIN, top + 17))
        draw.text((CAPTION_MARGIN, top + 28), f"{over.low:.3g}", fill=(20, 20, 20), font=font)
        draw.text((CAPTION_MARGIN + wide, top + 28), f"{over.high:.3g}", fill=(20, 20, 20), font=font, anchor="ra")
    return picture


def strip_markdown(words: str) -> str:
    """Remove the marks of Markdown."""
    return re.sub(r"\*\*|  $", "", words, flags=re.MULTILINE)


def encode_png(picture: Image.Image) -> bytes:
    out = io.BytesIO()
    picture.save(out, "PNG")
    return out.getvalue()


class Film:
    """A film of a trial from its first to its last instant, being taken."""

    def __init__(self, client: viser.ClientHandle, end: float, speed: float) -> None:
        """Film a trial that ends at `end` (s), `speed` times as fast. Raises DataError for too many pictures."""
        self.client, self._step, self.end = client, speed / FILM_RATE, end
        self.length = int(end / self._step) + 1
        if self.length > MOST_PICTURES:
            least = end * FILM_RATE / (MOST_PICTURES - 1)
            raise DataError(
                f"a film of {self.length} pictures is too long, at most {MOST_PICTURES}: set the speed to {least:.1f} or more"
            )
        self._pictures: list[Image.Image] = []

    @property
    def time(self) -> float:
        """Return the time in the trial of the next picture, s."""
        return min(len(self._pictures) * self._step, self.end)

    @property
    def done(self) -> bool:
        return len(self._pictures) == self.length

    def add_picture(self, words: str, ranges: Sequence[ColourScale]) -> None:
        """Add a picture of the present scene. Raises DataError where none comes."""
        picture = add_caption(take_picture(self.client), words, ranges)
        self._pictures.append(picture.quantize(256, dither=Image.Dither.NONE))

    def encode_gif(self) -> bytes:
        out, (first, *others) = io.BytesIO(), self._pictures
        first.save(out, "GIF", save_all=True, append_images=others, duration=round(1e3 / FILM_RATE), loop=0)
        return out.getvalue()
