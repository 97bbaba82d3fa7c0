"""Write small policies as the documentation of learners' libraries does, into this folder.

Needs torch, onnxscript, stable-baselines3 and pipeline.gym: python make_exports.py. Made with torch 2.13.0,
those of levels and those that are gated with 2.15.0, and Stable-Baselines3 2.9.2; weights are random.
"""

from pathlib import Path

import torch
from onnx import helper, load, save
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


class SplitLevels(nn.Module):
    """As CleanRL chooses several actions, without noise."""

    def __init__(self, network, probable):
        super().__init__()
        self.network, self.probable = network, probable

    def forward(self, x):
        parts = torch.split(self.network(x), [3, 3, 3], dim=1)
        if self.probable:
            return torch.cat([torch.softmax(part, 1).argmax(1, keepdim=True) for part in parts], 1)
        return torch.stack([part.argmax(1) for part in parts], 1)


class ShapedLevels(nn.Module):
    """The numbers of each axis in a row."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, x):
        return self.network(x).reshape(-1, 3, 3).argmax(-1)


def gated():
    """What gates its numbers, and what normalises them."""
    layers = [nn.Linear(19, 6), nn.LayerNorm(6), nn.SiLU(), nn.Linear(6, 6), nn.GELU(), nn.Linear(6, 5)]
    return nn.Sequential(*layers, nn.GELU("tanh"), nn.Linear(5, 3))


def export_levels():
    """Write those whose answer is which level is best along each axis."""
    env = NormalizedObservation(InspectionEnv(["duration_s=100"], levels_n=0.1))
    ppo = PPO("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, device="cpu", seed=1)
    nn.init.orthogonal_(ppo.policy.action_net.weight)
    network = nn.Sequential(nn.Linear(19, 8), nn.Tanh(), nn.Linear(8, 9))
    (FOLDER / "levels").mkdir(exist_ok=True)
    for name, module, options in (
        ("sb3", OnnxablePolicy(ppo.policy), {"opset_version": 17, "dynamo": False}),
        ("cleanrl", SplitLevels(network, probable=False), {"opset_version": 11, "dynamo": False}),
        ("cleanrl_dynamo", SplitLevels(network, probable=False), {"external_data": False}),
        ("probable_dynamo", SplitLevels(network, probable=True), {"external_data": False}),
        ("shaped", ShapedLevels(network), {"dynamo": False}),
        ("shaped_dynamo", ShapedLevels(network), {"external_data": False}),
    ):
        export(f"levels/{name}", module, **options)
        path = FOLDER / "levels" / f"{name}.onnx"
        model = load(path)
        helper.set_model_props(model, {"forces": "levels", "levels_n": "0.1"})
        save(model, path)


def export(name, module, **options):
    """Write a file; PyTorch's present exporter also writes NAME.onnx.data.

    It notes where in which files each node was made, which is left out: those are of one machine.
    """
    path = FOLDER / f"{name}.onnx"
    torch.onnx.export(module.eval(), (SEEN,), str(path), verbose=False, **options)
    model = load(path, load_external_data=False)
    for part in (*model.graph.node, *model.graph.value_info, *model.graph.input, *model.graph.output):
        del part.metadata_props[:]
    save(model, path)


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
    export_levels()
    export("gated", gated(), opset_version=13, dynamo=False)
    export("gated_dynamo", gated(), external_data=False)


if __name__ == "__main__":
    main()
