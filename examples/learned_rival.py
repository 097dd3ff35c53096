"""A learned rival:

PPO trains a policy on the inverted pendulum's environment, and it meets the laws of the shelf.

    pip install '.[rl]' stable-baselines3
    python examples/learned_rival.py            # train five seeds, a minute each, then compare

The policy sees the angle, its rate, its last action, and the integral of the angle, without which a
constant load leaves an offset. It is trained for what laws are tuned for, less angle and less
variation of the command, from all starts of the comparison, under constant torques of up to 1 N m,
with a period of 10 ms. It runs at the period of all laws, 1 ms. Bound, plant, starts, noise and
loads of the comparison are the same for all. No seed is left out.
"""

# pyright: reportMissingImports=false
# (torch and stable-baselines3 are installed for this script alone)
import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

import smc_mujoco as smc
from smc_mujoco.control.law import Law

PLANT, CONDITIONS = "inverted_pendulum", ["nominal", "noise", "constant", "sine", "coulomb"]
RIVALS = ["pd_observer", "adrc", "mpc", "super_twisting", "pid"]
COPIES, PERIOD, DURATION = 64, 0.01, 3.0  # s
BOUND, LOAD = (
    6.0,
    1.0,
)  # N m; the environment's own bound is their sum, so that a load adds to the command
SCALES = np.array([0.5, 3.0, 0.2])  # of angle, rate and integral
SMOOTH = (
    0.2  # cost of a change of the command by the bound, against an angle of 0.5 rad for a period
)


class Training(VecEnv):
    """Copies of the pendulum, each with its own load in an episode.

    All episodes end together, at their full length.
    """

    def __init__(self, seed: int):
        changes = {"control_period": PERIOD, "duration": DURATION, "u_max": BOUND + LOAD}
        environments = gymnasium.make_vec(
            "smc_mujoco:smc/InvertedPendulum-v0", num_envs=COPIES, task="regulate", changes=changes
        )
        self.copies, self.random, self.first = environments, np.random.default_rng(seed), seed
        space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float32)
        super().__init__(COPIES, space, environments.single_action_space)

    def reset(self) -> np.ndarray:
        """Begin an episode in all copies."""
        seen, _ = self.copies.reset(seed=self.first)
        self.first = None
        self.load = self.random.uniform(-LOAD, LOAD, (COPIES, 1))
        self.integral, self.last = np.zeros((COPIES, 1)), np.zeros((COPIES, 1))
        return self.observed(seen)

    def observed(self, seen: np.ndarray) -> np.ndarray:
        """Return what the policy sees."""
        return np.hstack([np.hstack([seen, self.integral]) / SCALES, self.last]).astype(np.float32)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of all copies."""
        self.actions = actions

    def step_wait(self) -> Any:
        """Return what follows: observations, rewards, ends of episodes."""
        seen, _, ended, cut, _ = self.copies.step(
            (BOUND * self.actions + self.load) / (BOUND + LOAD)
        )
        self.integral = self.integral + PERIOD * seen[:, :1]
        cost = (
            np.minimum(np.abs(seen[:, 0]) / SCALES[0], 2.0)
            + SMOOTH * np.abs(self.actions - self.last)[:, 0]
        )
        self.last, done = self.actions.copy(), ended | cut
        observations, infos = self.observed(seen), [{} for _ in range(COPIES)]
        if done.any():
            assert done.all()
            assert not ended.any()
            infos = [
                {"terminal_observation": observation, "TimeLimit.truncated": True}
                for observation in observations
            ]
            observations = self.reset()
        return observations, -cost.astype(np.float32), done, infos

    def close(self) -> None:
        """Free the copies."""
        self.copies.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of every copy."""
        return [getattr(self.copies, attr_name)] * COPIES

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse, as copies have no attributes of their own."""
        raise NotImplementedError

    def env_method(
        self, method_name: str, *arguments: Any, indices: Any = None, **named: Any
    ) -> list[Any]:
        """Refuse, as copies have no methods of their own."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no copy has a wrapper."""
        return [False] * COPIES


def law_of(layers: list[tuple[np.ndarray, np.ndarray]], name: str) -> Law:
    """Return a trained network as a law that compiles.

    It acts without chance; its memory is what the policy saw.
    """
    (w1, b1), (w2, b2), (w3, b3) = layers
    n, scales = len(b1), SCALES

    @smc.law_function(memory=2 * n + 2)
    def policy(y, gains, memory):
        # memory: the integral, the last action, and both layers
        for i in range(n):
            total = b1[i] + w1[i, 0] * y.e / scales[0] + w1[i, 1] * y.de / scales[1]
            memory[2 + i] = math.tanh(
                total + w1[i, 2] * memory[0] / scales[2] + w1[i, 3] * memory[1]
            )
        for i in range(n):
            total = b2[i]
            for j in range(n):
                total += w2[i, j] * memory[2 + j]
            memory[2 + n + i] = math.tanh(total)
        action = b3[0]
        for i in range(n):
            action += w3[0, i] * memory[2 + n + i]
        memory[0] += y.dt * y.e
        memory[1] = min(max(action, -1.0), 1.0)
        return y.limit * memory[1], action

    return policy().named(name)


def trained(seed: int, steps: int, path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """Train a policy, or read it, and return its layers."""
    if not path.exists():
        torch.set_num_threads(1)
        start = time.process_time()
        network, rate = {"net_arch": [32, 32], "log_std_init": -1.0}, lambda left: 1e-3 * left
        model = PPO(
            "MlpPolicy",
            Training(seed),
            n_steps=50,
            batch_size=800,
            n_epochs=8,
            learning_rate=rate,
            gamma=0.98,
            policy_kwargs=network,
            seed=seed,
            device="cpu",
        )
        model.learn(steps)
        parts = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
        layers = [(part.weight, part.bias) for part in parts if isinstance(part, torch.nn.Linear)]
        path.write_text(
            json.dumps(
                [[w.detach().double().tolist(), b.detach().double().tolist()] for w, b in layers]
            )
        )
        print(
            f"seed {seed}: {steps} steps, {time.process_time() - start:.0f} s of processor time",
            flush=True,
        )
    return [(np.array(w), np.array(b)) for w, b in json.loads(path.read_text())]


def main() -> None:
    """Train, and compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=1_000_000, help="of 10 ms, for each seed")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("learned"))
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    laws = []
    for seed in range(options.seeds):
        layers = trained(seed, options.steps, options.out / f"ppo-{options.steps}-{seed}.json")
        laws.append(law_of(layers, f"ppo_{seed}"))
    print(
        smc.compare([*laws, *RIVALS], PLANT, CONDITIONS, duration=4.0, out=options.out / "compared")
    )


if __name__ == "__main__":
    main()
