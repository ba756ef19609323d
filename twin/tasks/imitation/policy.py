"""Networks that imitate demonstrations in one representation (torch): diffusion, and cloning by least squares.

    y = (x - mean) B / span              (DIRECTIONS_KEPT,) main directions of the demonstrations, within -1 to 1
    o = (y_i, y_{i-FRAMES_BACK}, i / n)  at frame i: the fingers now and a little before, and how much time has passed
    a = (y_{i+1} .. y_{i+CHUNK_FRAMES})  the frames that followed; EXECUTED_FRAMES of them are executed before the next a

Cloning is a = f(o), with least squares. Diffusion draws a from p(a | o): f(o, a_k, k) learns a from a_k = sqrt(s_k) a + sqrt(1 -
s_k) e, e normal, and a is found from pure noise in DENOISING_STEPS steps of DDIM. Encoders are not in o: the demonstrations had
slack tendons.

Sources: Chi et al. 2023 (diffusion policy, arXiv 2303.04137), Song et al. 2021 (DDIM), Nichol and Dhariwal 2021 (the schedule s_k),
by `diffusers`; sizes are ours.
"""

from collections.abc import Sequence
from typing import cast

import numpy as np
import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from torch import Tensor, nn

DIRECTIONS_KEPT = 8  # 99.9 % of the variance of the demonstrations in any representation of each task
SMALLEST_SPAN_SHARE = 0.01  # of the widest direction: narrower ones are noise, and are not scaled up
FRAMES_BACK = 5  # 0.2 s
CHUNK_FRAMES, EXECUTED_FRAMES = 8, 4  # 0.32 and 0.16 s
FRAMES_AHEAD = 2  # of the wanted frame: the fingers lag by some 0.05 s, and a frame is 0.04 s
NOISE_LEVELS, DENOISING_STEPS = 50, 10
HIDDEN_UNITS = 256
OBSERVATION_SIZE, ACTION_SIZE = 2 * DIRECTIONS_KEPT + 1, CHUNK_FRAMES * DIRECTIONS_KEPT


class PolicyNetwork(nn.Module):
    """A network with the scales of its demonstrations; all of it is in its state dictionary."""

    mean: Tensor
    basis: Tensor
    span: Tensor
    frames: Tensor
    kind = "cloning"

    def __init__(self, width: int) -> None:
        """Make an untrained network for x (width,)."""
        super().__init__()
        for name, shape in {"mean": (width,), "basis": (width, DIRECTIONS_KEPT), "span": (DIRECTIONS_KEPT,), "frames": ()}.items():
            self.register_buffer(name, torch.ones(shape))
        inner = (nn.Linear(HIDDEN_UNITS, HIDDEN_UNITS), nn.SiLU(), nn.Linear(HIDDEN_UNITS, HIDDEN_UNITS), nn.SiLU())
        self.body = nn.Sequential(
            nn.Linear(OBSERVATION_SIZE + ACTION_SIZE + 1, HIDDEN_UNITS), nn.SiLU(), *inner, nn.Linear(HIDDEN_UNITS, ACTION_SIZE)
        )

    def fit_scaling(self, episodes: Sequence[np.ndarray]) -> None:
        """Set the scales by the demonstrations, each (n, width)."""
        x = np.concatenate(episodes)
        mean = x.mean(axis=0)
        basis = np.linalg.svd(x - mean, full_matrices=False)[2][:DIRECTIONS_KEPT].T
        y = (x - mean) @ basis
        span = np.abs(y).max(axis=0)
        span = np.maximum(span, SMALLEST_SPAN_SHARE * span.max())
        for name, value in {"mean": mean, "basis": basis, "span": span, "frames": len(x) / len(episodes)}.items():
            getattr(self, name).copy_(torch.as_tensor(value))

    def normalise(self, x: np.ndarray) -> Tensor:
        """Return y (..., DIRECTIONS_KEPT) of x (..., width)."""
        return (torch.as_tensor(x, dtype=torch.float32) - self.mean) @ self.basis / self.span

    def denormalise(self, y: Tensor) -> np.ndarray:
        """Return x (..., width) of y (..., DIRECTIONS_KEPT)."""
        return (self.mean + (y * self.span) @ self.basis.T).numpy().astype(float)

    def training_pairs(self, episodes: Sequence[np.ndarray]) -> tuple[Tensor, Tensor]:
        """Return o (n, OBSERVATION_SIZE) and a (n, ACTION_SIZE) of every frame; the first and last frames are repeated beyond the
        ends."""
        o, a = [], []
        for x in episodes:
            y, i = self.normalise(x), np.arange(len(x))
            o.append(torch.cat([y, y[np.maximum(i - FRAMES_BACK, 0)], torch.from_numpy(i).float()[:, None] / self.frames], 1))
            a.append(y[np.minimum(i[:, None] + np.arange(1, CHUNK_FRAMES + 1), len(x) - 1)].flatten(1))
        return torch.cat(o), torch.cat(a)

    def forward(self, o: Tensor, a: Tensor, k: Tensor) -> Tensor:
        """Return the network's a for o, a_k and k."""
        return self.body(torch.cat([o, a, k[:, None].float() / NOISE_LEVELS], 1))

    def loss(self, o: Tensor, a: Tensor, rng: torch.Generator) -> Tensor:
        """Return the mean square error of a."""
        return ((self(o, torch.zeros_like(a), torch.zeros(len(a))) - a) ** 2).mean()

    def sample_actions(self, o: Tensor, rng: torch.Generator) -> Tensor:
        """Return a (n, ACTION_SIZE) for o."""
        return self(o, torch.zeros(len(o), ACTION_SIZE), torch.zeros(len(o)))


class CloningNetwork(PolicyNetwork):
    """Behaviour cloning: the mean of the frames that followed."""


class DiffusionNetwork(PolicyNetwork):
    """Diffusion: one of the ways in which the demonstrations went on."""

    kind = "diffusion"

    def __init__(self, width: int) -> None:
        super().__init__(width)
        self.schedule = DDIMScheduler(NOISE_LEVELS, beta_schedule="squaredcos_cap_v2", prediction_type="sample")

    def loss(self, o: Tensor, a: Tensor, rng: torch.Generator) -> Tensor:
        e, k = torch.randn(a.shape, generator=rng), torch.randint(NOISE_LEVELS, (len(a),), generator=rng)
        return ((self(o, self.schedule.add_noise(a, e, cast(torch.IntTensor, k)), k) - a) ** 2).mean()

    def sample_actions(self, o: Tensor, rng: torch.Generator) -> Tensor:
        self.schedule.set_timesteps(DENOISING_STEPS)
        a = torch.randn(len(o), ACTION_SIZE, generator=rng)
        for k in self.schedule.timesteps:
            a = self.schedule.step(self(o, a, k.expand(len(o))), int(k), a, return_dict=False)[0]
        return a


class PolicyExecutor:
    """Executes a network in one trial: x (width,) of every frame to the wanted x (width,) now.

    Its own wanted frames stand for the observed ones, except for the first: fingers that press lag behind, and continuing from
    where they are would stop pressing (0 of 5 cylinders turned; with a tenth of the observation mixed in 0 of 3; without 2 of 3).
    """

    def __init__(self, policy: PolicyNetwork, seed: int) -> None:
        self.policy, self.rng = policy, torch.Generator().manual_seed(seed)
        self.past: list[Tensor] = []
        self.chunk = torch.empty(0)

    @torch.no_grad()
    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the wanted x (width,) for the observed x (width,)."""
        i = len(self.past)
        self.past.append(self.chunk[(i - 1) % EXECUTED_FRAMES] if i else self.policy.normalise(x))
        if i % EXECUTED_FRAMES == 0:
            o = torch.cat([self.past[i], self.past[max(0, i - FRAMES_BACK)], torch.full((1,), float(i)) / self.policy.frames])
            self.chunk = self.policy.sample_actions(o[None], self.rng).reshape(CHUNK_FRAMES, DIRECTIONS_KEPT)
        return self.policy.denormalise(self.chunk[i % EXECUTED_FRAMES + FRAMES_AHEAD - 1])


POLICIES: dict[str, type[PolicyNetwork]] = {"diffusion": DiffusionNetwork, "cloning": CloningNetwork}
