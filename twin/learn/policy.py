"""Policies that a network holds, of what was shown by one way (torch): diffusion, and cloning by least squares.

    y = (x - mean) B / span              (KEPT,) main directions of what was shown, within -1 to 1
    o = (y_i, y_{i-BACK}, i / n)         at frame i: the fingers now and a little before, and how far the time is
    a = (y_{i+1} .. y_{i+CHUNK})         what was shown to follow; DONE frames of it are done, then it is asked for anew

Cloning is a = f(o), with least squares. Diffusion draws a from p(a | o): f(o, a_k, k) learns a from
a_k = sqrt(s_k) a + sqrt(1 - s_k) e, e normal, and a is found from pure noise in LOOKS steps of DDIM. Encoders are not in o: tendons
were slack while it was shown.

Sources: Chi et al. 2023 (diffusion policy, arXiv 2303.04137), Song et al. 2021 (DDIM), Nichol and Dhariwal 2021 (the schedule
s_k), by `diffusers`; sizes are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from torch import Tensor, nn

KEPT = 8  # directions: 99.9 % of the variance of what is shown by any way at each task
FLAT = 0.01  # of the widest direction: what is narrower is noise, and is not blown up
BACK = 5  # frames, 0.2 s
CHUNK, DONE = 8, 4  # frames: 0.32 and 0.16 s
SOON = 2  # frames ahead of what is wanted now: what is followed lags by some 0.05 s, and a frame is 0.04 s
NOISES, LOOKS = 50, 10
WIDE = 256
SEEN, ASKED = 2 * KEPT + 1, CHUNK * KEPT


class Policy(nn.Module):
    """A network with the scales of what it was taught; all of it is in its state dictionary."""

    mean: Tensor
    basis: Tensor
    span: Tensor
    frames: Tensor
    kind = "cloning"

    def __init__(self, width: int) -> None:
        """For x (width,), not taught yet."""
        super().__init__()
        for name, shape in {"mean": (width,), "basis": (width, KEPT), "span": (KEPT,), "frames": ()}.items():
            self.register_buffer(name, torch.ones(shape))
        inner = (nn.Linear(WIDE, WIDE), nn.SiLU(), nn.Linear(WIDE, WIDE), nn.SiLU())
        self.body = nn.Sequential(nn.Linear(SEEN + ASKED + 1, WIDE), nn.SiLU(), *inner, nn.Linear(WIDE, ASKED))

    def scale(self, episodes: Sequence[np.ndarray]) -> None:
        """Take the scales from what was shown, each (n, width)."""
        x = np.concatenate(episodes)
        mean = x.mean(axis=0)
        basis = np.linalg.svd(x - mean, full_matrices=False)[2][:KEPT].T
        y = (x - mean) @ basis
        span = np.abs(y).max(axis=0)
        span = np.maximum(span, FLAT * span.max())
        for name, value in {"mean": mean, "basis": basis, "span": span, "frames": len(x) / len(episodes)}.items():
            getattr(self, name).copy_(torch.as_tensor(value))

    def inward(self, x: np.ndarray) -> Tensor:
        """y (..., KEPT) of x (..., width)."""
        return (torch.as_tensor(x, dtype=torch.float32) - self.mean) @ self.basis / self.span

    def outward(self, y: Tensor) -> np.ndarray:
        return (self.mean + (y * self.span) @ self.basis.T).numpy().astype(float)

    def pairs(self, episodes: Sequence[np.ndarray]) -> tuple[Tensor, Tensor]:
        """o (n, SEEN) and a (n, ASKED) of every frame shown; before the first and after the last they stay."""
        o, a = [], []
        for x in episodes:
            y, i = self.inward(x), np.arange(len(x))
            o.append(torch.cat([y, y[np.maximum(i - BACK, 0)], torch.from_numpy(i).float()[:, None] / self.frames], 1))
            a.append(y[np.minimum(i[:, None] + np.arange(1, CHUNK + 1), len(x) - 1)].flatten(1))
        return torch.cat(o), torch.cat(a)

    def forward(self, o: Tensor, a: Tensor, k: Tensor) -> Tensor:
        return self.body(torch.cat([o, a, k[:, None].float() / NOISES], 1))

    def loss(self, o: Tensor, a: Tensor, rng: torch.Generator) -> Tensor:
        """Mean square error of a."""
        return ((self(o, torch.zeros_like(a), torch.zeros(len(a))) - a) ** 2).mean()

    def draw(self, o: Tensor, rng: torch.Generator) -> Tensor:
        """a (n, ASKED)."""
        return self(o, torch.zeros(len(o), ASKED), torch.zeros(len(o)))


class Cloning(Policy):
    """Behaviour cloning: the mean of what follows."""


class Diffusion(Policy):
    """One of the ways in which it was shown to go on."""

    kind = "diffusion"

    def __init__(self, width: int) -> None:
        super().__init__(width)
        self.schedule = DDIMScheduler(NOISES, beta_schedule="squaredcos_cap_v2", prediction_type="sample")

    def loss(self, o: Tensor, a: Tensor, rng: torch.Generator) -> Tensor:
        e, k = torch.randn(a.shape, generator=rng), torch.randint(NOISES, (len(a),), generator=rng)
        return ((self(o, self.schedule.add_noise(a, e, cast(torch.IntTensor, k)), k) - a) ** 2).mean()

    def draw(self, o: Tensor, rng: torch.Generator) -> Tensor:
        self.schedule.set_timesteps(LOOKS)
        a = torch.randn(len(o), ASKED, generator=rng)
        for k in self.schedule.timesteps:
            a = self.schedule.step(self(o, a, k.expand(len(o))), int(k), a, return_dict=False)[0]
        return a


class Acting:
    """One trial's: x (width,) of every frame to what is wanted (width,) now. What it wanted stands for what is seen, but for the
    first frame: fingers that press lag behind, and to go on from where they are is to press no more (0 of 5 cylinders turned; with
    a tenth of what is seen, 0 of 3; else 2 of 3)."""

    def __init__(self, policy: Policy, seed: int) -> None:
        self.policy, self.rng = policy, torch.Generator().manual_seed(seed)
        self.past: list[Tensor] = []
        self.chunk = torch.empty(0)

    @torch.no_grad()
    def __call__(self, x: np.ndarray) -> np.ndarray:
        i = len(self.past)
        self.past.append(self.chunk[(i - 1) % DONE] if i else self.policy.inward(x))
        if i % DONE == 0:
            o = torch.cat([self.past[i], self.past[max(0, i - BACK)], torch.full((1,), float(i)) / self.policy.frames])
            self.chunk = self.policy.draw(o[None], self.rng).reshape(CHUNK, KEPT)
        return self.policy.outward(self.chunk[i % DONE + SOON - 1])


POLICIES: dict[str, type[Policy]] = {"diffusion": Diffusion, "cloning": Cloning}
