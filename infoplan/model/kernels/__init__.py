"""The kernels: a module each, called as `model.kernel` calls it, that holds its `KERNEL`."""

from importlib import import_module

from infoplan.model.kernel import Kernel


def as_kernel(kernel: str | Kernel) -> Kernel:
    """Return the kernel of a name in `infoplan.config.KERNELS`, or the kernel that is given."""
    if isinstance(kernel, Kernel):
        return kernel
    found: Kernel = import_module(f"{__name__}.{kernel}").KERNEL
    return found
