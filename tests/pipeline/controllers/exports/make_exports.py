"""Write small policies as the documentation of learners' libraries does, into this folder.

Needs torch, onnxscript, stable-baselines3 and pipeline.gym: python make_exports.py. Made with torch 2.13.0
and Stable-Baselines3 2.9.2; weights are random.
"""

from pathlib import Path

import torch
from stable_baselines3 import PPO, SAC
from torch import nn

from pipeline.gym import InspectionEnv, NormalizedObservation

FOLDER = Path(__file__).parent
SEEN = torch.zeros(1, 19)


class OnnxablePolicy(nn.Module):
    """Stable-Baselines3's guide, Exporting models: PPO, whose policy has three outputs."""

    def __init__(self, policy):
        super().__init__()
        self.policy = policy

    def forward(self, observation):
        return self.policy(observation, deterministic=True)


class Normaliser(nn.Module):
    """RSL-RL's empirical normalisation."""

    def __init__(self):
        super().__init__()
        self.register_buffer("_mean", torch.randn(1, 19))
        self.register_buffer("_std", torch.rand(1, 19) + 0.5)

    def forward(self, x):
        return (x - self._mean) / (self._std + 1e-2)


class Exporter(nn.Module):
    """RSL-RL's exporter: the normaliser, then the actor, with ELU as its default."""

    def __init__(self):
        super().__init__()
        self.normalizer = Normaliser()
        self.actor = nn.Sequential(nn.Linear(19, 8), nn.ELU(), nn.Linear(8, 6), nn.ELU(), nn.Linear(6, 3))

    def forward(self, x):
        return self.actor(self.normalizer(x))


def cleanrls_actor():
    """CleanRL's actor of continuous actions."""

    def layer(num_in, num_out, std=2.0**0.5):
        linear = nn.Linear(num_in, num_out)
        nn.init.orthogonal_(linear.weight, std)
        nn.init.constant_(linear.bias, 0.0)
        return linear

    return nn.Sequential(layer(19, 8), nn.Tanh(), layer(8, 8), nn.Tanh(), layer(8, 3, std=0.01))


def others():
    """Other activations."""
    layers = [nn.Linear(19, 6), nn.Softplus(), nn.Linear(6, 6), nn.Sigmoid(), nn.Linear(6, 5), nn.LeakyReLU()]
    return nn.Sequential(*layers, nn.Linear(5, 3), nn.Hardtanh())


def export(name, module, **options):
    """Write a file; PyTorch's present exporter also writes NAME.onnx.data."""
    torch.onnx.export(module.eval(), (SEEN,), str(FOLDER / f"{name}.onnx"), verbose=False, **options)


def main():
    """Write all files."""
    torch.manual_seed(0)
    env = NormalizedObservation(InspectionEnv(["duration_s=100"]))
    ppo = PPO("MlpPolicy", env, policy_kwargs={"net_arch": [8, 8]}, device="cpu", seed=1)
    sac = SAC("MlpPolicy", env, policy_kwargs={"net_arch": [8, 8]}, device="cpu", seed=1, buffer_size=10)
    theirs = {"opset_version": 17, "input_names": ["input"], "dynamo": False}
    export("sb3_ppo", OnnxablePolicy(ppo.policy), **theirs)
    export("sb3_sac", OnnxablePolicy(sac.policy.actor), **theirs)
    names = {"input_names": ["obs"], "output_names": ["actions"]}
    export("rsl_rl", Exporter(), **names, opset_version=11, dynamic_axes={}, dynamo=False)
    export("rsl_rl_dynamo", Exporter(), **names, opset_version=18)
    export("cleanrl_dynamo", cleanrls_actor())
    export("cleanrl", cleanrls_actor(), dynamo=False)
    export("others_dynamo", others())
    export("others", others(), dynamo=False)


if __name__ == "__main__":
    main()
