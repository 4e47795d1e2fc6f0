"""The simulation of the Rust core as an operation of JAX: forces of a damper, with their exact derivatives.

XLA calls the compiled module from within a program, without Python (its foreign function interface). The motion of a
record, with its splines, is an operand like the parameters, so a compiled program holds for every record of its length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import jax
import jax.interpreters.batching
import jax.interpreters.mlir
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.custom_derivatives import SymbolicZero
from jax.extend.core import Primitive

from mrwork import _rust
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import LibraryError, SettingError
from mrwork.store.codec import package_version
from mrwork.twins.model_twins import begin
from mrwork.twins.record_arrays import RecordArrays

# jax leaves these unannotated.
_jax: Any = jax
_ffi: Any = jax.ffi
_interpreters: Any = jax.interpreters

_TARGET = "mrwork_damper_force"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel:
    """Constants of a compiled simulation; equal values share one compilation.

    `columns` are the columns of `theta` by which the forces are differentiated. `substeps` per sample interval are the
    same for every candidate, or follow from its stiffness where they are 0. The operation is registered with the first.
    """

    spec: DamperSpec
    columns: tuple[int, ...]
    substeps: int = 0
    threads: int = 1

    def __post_init__(self) -> None:
        begin()
        _register()

    def __call__(self, theta: Array, record: RecordArrays) -> Array:
        """Forces [N], shape (..., n_time), of parameters (..., n_params); rows that failed are infinite."""
        force: Array = _simulate(self, theta, record)
        return force


@cache
def _register() -> None:
    """Register the operation; a version of jaxlib that does not take it raises a LibraryError."""
    address, (major, minor) = _rust.xla_handler()
    try:
        _ffi.register_ffi_target(_TARGET, _ffi.pycapsule(address), platform="cpu")
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise LibraryError(
            f"mr.jax speaks XLA's interface {major}.{minor}, which jaxlib {package_version('jaxlib')} refuses "
            f"({reason}); install jax 0.12"
        ) from None


# An identity that has no program but on the processor, so that a program for another device is refused by a sentence.
_on_processor: Any = Primitive("mrwork_on_processor")
_on_processor.def_impl(lambda theta: theta)
_on_processor.def_abstract_eval(lambda theta: theta)


def _refuse_device(context: Any, theta: Any) -> Any:
    raise SettingError(
        f"mr.jax simulates on the processor, and this program is compiled for {context.module_context.platforms[0]}; "
        "set JAX_PLATFORMS=cpu, or put the arrays on jax.devices('cpu')[0]"
    )


_interpreters.batching.defvectorized(_on_processor)
_interpreters.mlir.register_lowering(_on_processor, lambda _, theta: [theta], platform="cpu")
_interpreters.mlir.register_lowering(_on_processor, _refuse_device)


def _call(kernel: Kernel, theta: Array, record: RecordArrays, *, derivatives: bool) -> tuple[Array, ...]:
    """The operation: force, and derivatives, (..., n_columns, n_time), if wanted."""
    leading = theta.shape[:-1]
    alone = [array.reshape(*(1 for _ in leading), *array.shape) for array in record]
    shapes = [(*leading, record.n_time)]
    if derivatives:
        shapes.append((*leading, len(kernel.columns), record.n_time))
    call = _ffi.ffi_call(
        _TARGET, [_jax.ShapeDtypeStruct(shape, jnp.float64) for shape in shapes], vmap_method="expand_dims"
    )
    results = call(
        _on_processor.bind(theta),
        *alone,
        model=kernel.spec.core_name,
        laws="\n".join(map(str, kernel.spec.laws)),
        rates=np.int64(kernel.spec.n_rates),
        columns=np.array(kernel.columns, dtype=np.int64),
        substeps=np.int64(kernel.substeps),
        threads=np.int64(kernel.threads),
    )
    return tuple(results)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _simulate(kernel: Kernel, theta: Array, record: RecordArrays) -> Array:
    return _call(kernel, theta, record, derivatives=False)[0]


@partial(_simulate.defjvp, symbolic_zeros=True)
def _differentiate(
    kernel: Kernel, primals: tuple[Array, RecordArrays], tangents: tuple[Any, RecordArrays]
) -> tuple[Array, Array]:
    theta, record = primals
    along, of_record = tangents
    if not all(isinstance(tangent, SymbolicZero) for tangent in of_record):
        raise SettingError(
            "the forces of mr.jax have derivatives with respect to parameters, not to the record; use mr.jax.twin"
        )
    force, jacobian = _linearise(kernel, theta, record)
    return force, jnp.einsum("...p,...pt->...t", along[..., np.array(kernel.columns, dtype=int)], jacobian)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _linearise(kernel: Kernel, theta: Array, record: RecordArrays) -> tuple[Array, Array]:
    force, jacobian = _call(kernel, theta, record, derivatives=True)
    return force, jacobian


@_linearise.defjvp
def _refuse_second(kernel: Kernel, primals: object, tangents: object) -> Any:
    raise SettingError(
        "the forces of mr.jax have first derivatives; take second ones from mr.jax.twin, or by differences of gradients"
    )
