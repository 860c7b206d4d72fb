"""Options of the callbacks that pass on stored runs, as Hydra checks them."""

from dataclasses import dataclass


@dataclass
class MlflowOptions:
    """What ``hydra.callbacks.mlflow.uri=`` and its like set; see `MlflowCallback`."""

    _target_: str = "infoplan.hydra_front.mlflow_callback.MlflowCallback"
    uri: str | None = None
    experiment: str = "infoplan"
    artifacts: bool = False
    claims: bool = True


@dataclass
class WandbOptions:
    """What ``hydra.callbacks.wandb.project=`` sets; see `WandbCallback`."""

    _target_: str = "infoplan.hydra_front.wandb_callback.WandbCallback"
    project: str = "infoplan"
