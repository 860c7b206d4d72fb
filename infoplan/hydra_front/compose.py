"""From overrides to a configuration, as Hydra composes it."""

import copy
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

from hydra import compose as hydra_compose
from hydra import version
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.utils import create_config_search_path
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.types import RunMode
from omegaconf import MISSING, DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from infoplan.config import GROUPS, Config
from infoplan.errors import UsageError
from infoplan.hydra_front.explain import explained
from infoplan.hydra_front.known_options import no_option
from infoplan.hydra_front.overrides import readable, values_of
from infoplan.hydra_front.tracker_options import MlflowOptions, WandbOptions
from infoplan.text_options import decimal, text_options

LOCK = threading.RLock()
"""Hydra keeps its state in the process: one thread at a time may change it."""


def compose(overrides: Sequence[str]) -> Config:
    """Compose one configuration as ``infoplan run`` with these overrides does.

    Works inside of another Hydra application, and leaves its state as it is. Its bounds are not
    checked yet (`infoplan.config.validate`).

    Raises
    ------
    UsageError
        If a choice, an option or the type of a value is wrong.
    """
    words = readable(overrides, several=False)
    with LOCK, version_base():
        register()
        loader = ConfigLoaderImpl(create_config_search_path("pkg://infoplan.conf"))
        with explained():
            composed = loader.load_configuration("config", words, RunMode.RUN, from_shell=False)
            with open_dict(composed):
                del composed["hydra"]
            check_texts(loader, words)
            return to_config(composed)


def register() -> None:
    """Register the schemas with Hydra, in this process only; the names are infoplan's alone."""
    store = ConfigStore.instance()
    if "infoplan_base.yaml" in store.repo:
        return  # it outlives a composition, unless another application empties it
    for group, choices in GROUPS.items():
        for name, schema in choices.items():
            store.store(group=f"infoplan_schema/{group}", name=name, node=schema)
    base = Config(planner=MISSING, detector=MISSING, terrain=MISSING, model=MISSING,
                  fault=MISSING)  # fmt: skip
    store.store(name="infoplan_base", node=base)
    target = "hydra_plugins.infoplan.PoolLauncher"
    store.store(group="hydra/launcher", name="infoplan", node={"_target_": target})
    store.store(group="hydra/callbacks", name="mlflow", node={"mlflow": MlflowOptions})
    store.store(group="hydra/callbacks", name="wandb", node={"wandb": WandbOptions})


class Composer:
    """Composes configurations with Hydra, many of them in little time.

    Hydra reads and merges all files anew for every job. Here that is done once for every choice of
    groups; plain options are set in a copy, as Hydra itself does it at the end.

    Parameters
    ----------
    config_name
        Name of the root configuration.
    of_sweep
        Jobs are entries of ``sweep``, of which their configurations then hold nothing: it may be
        long, and each has a copy.
    """

    def __init__(self, config_name: str, *, of_sweep: bool = False):
        self.config_name, self.of_sweep = config_name, of_sweep
        self.parser = OverridesParser.create()
        self.composed: dict[tuple[str, ...], DictConfig] = {}
        # The jobs of a sweep have their overrides from a few.
        self.parsed = cache(self.parser.parse_override)

    def __call__(self, overrides: Sequence[str]) -> DictConfig:
        """Compose the configuration of a job's overrides."""
        parsed = [self.parsed(word) for word in overrides]
        plain = [override for override in parsed if self._is_plain(override)]
        groups = tuple(override.input_line or "" for override in parsed if override not in plain)
        if groups not in self.composed:
            self.composed[groups] = hydra_compose(self.config_name, overrides=list(groups))
            if self.of_sweep:
                self.composed[groups].sweep = []
        config = copy.deepcopy(self.composed[groups])
        try:
            for override in plain:
                OmegaConf.update(config, override.key_or_group, override.value(), merge=True)
        except OmegaConfBaseException:
            return hydra_compose(self.config_name, overrides=list(overrides))  # for its message
        return config

    def _is_plain(self, override: Override) -> bool:
        """Whether an override sets an option of a group or of the root, and does nothing else."""
        name = override.key_or_group
        changes = override.type == OverrideType.CHANGE and override.package is None
        return changes and name not in (*GROUPS, "experiment") and "/" not in name


def to_config(composed: DictConfig) -> Config:
    """Make a configuration of what Hydra has composed; refuse what is none."""
    config = OmegaConf.to_object(composed)
    if not isinstance(config, Config):
        raise UsageError("this is no configuration of infoplan's: leave out --config-name")
    for name in _added_keys(config):
        raise UsageError(no_option(name))
    for group in GROUPS:
        if not is_dataclass(getattr(config, group)):
            raise UsageError(f"{group} must be chosen: give {group}={'|'.join(GROUPS[group])}")
    return without_rounding(config)


def without_rounding(value: Any) -> Any:
    """Free all numbers of a configuration from the rounding of the steps that led to them."""
    if isinstance(value, float):
        return decimal(value)
    if isinstance(value, list):
        return [without_rounding(entry) for entry in value]
    if isinstance(value, dict):
        return {key: without_rounding(entry) for key, entry in value.items()}
    if is_dataclass(value):
        for name, entry in vars(value).items():
            setattr(value, name, without_rounding(entry))
    return value


def _added_keys(config: object, prefix: str = "") -> Iterator[str]:
    """Names that ``+name=value`` has added: Hydra lets them through, infoplan would ignore them."""
    known = {item.name for item in fields(config)}  # type: ignore[arg-type]
    for name, value in vars(config).items():
        if name not in known:
            yield prefix + name
        elif is_dataclass(value):
            yield from _added_keys(value, f"{prefix}{name}.")


def check_texts(loader: Any, overrides: Sequence[str]) -> None:
    """Refuse text without quotes in an experiment's file that YAML has read as something else."""
    for experiment in values_of("experiment", overrides):
        loaded = loader.repository.load_config(f"experiment/{experiment}")
        content = OmegaConf.to_container(loaded.config) if loaded else None
        for name, value in _flat(content if isinstance(content, dict) else {}):
            if name in text_options() and not isinstance(value, str | None):
                raise UsageError(
                    f"experiment={experiment}: {name} is text, but YAML reads what stands there as "
                    f"{value}: put it in quotes"
                )


def _flat(content: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


@contextmanager
def version_base() -> Iterator[None]:
    """Let Hydra behave as of version 1.3, whatever an application around this one has chosen."""
    chosen = version.getbase()
    version.setbase("1.3")
    try:
        yield
    finally:
        version.VersionBase.instance().version_base = chosen
