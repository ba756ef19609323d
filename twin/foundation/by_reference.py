"""Named tuples that compiled functions get as one pointer instead of by value.

Numba passes a named tuple by value: each use of it, and of each tuple in it, copies all its arrays and counts their references, so
the code grows with uses times arrays. The rod's statics, where the state of a trial holds 65 arrays, compiled in 34 s by value and
in 18 s by reference; a prediction of the bundled recording took 0.115 and 0.084 s (one core, 2026-11-30).
"""

from __future__ import annotations

import hashlib
from typing import Any

from numba.core import types
from numba.experimental import structref
from numba.experimental.jitclass.base import imp_dtor
from numba.extending import NativeValue, box, intrinsic, typeof_impl, unbox

_BY_REFERENCE: set[type] = set()


@structref.register
class Reference(types.StructRef):
    """Numba's type of a pointer to the fields of a named tuple; `by_value` is the type of the tuple itself."""

    def __init__(self, by_value: Any) -> None:
        self.by_value = by_value
        super().__init__([(n, reference_type(t)) for n, t in zip(by_value.fields, by_value, strict=True)])
        # a short name, since numba writes it at each use in the code that it compiles
        self.name = f"{by_value.instance_class.__name__}&{hashlib.sha256(str(by_value).encode()).hexdigest()[:16]}"


def reference_type(by_value: Any) -> Any:
    """Return numba's type of a value in compiled code: a pointer for tuples of `by_reference` classes, others as they are."""
    if isinstance(by_value, types.BaseNamedTuple) and by_value.instance_class in _BY_REFERENCE:  # type: ignore[attr-defined]
        members = [m.by_value if isinstance(m, Reference) else types.unliteral(m) for m in by_value]  # type: ignore[attr-defined]
        return Reference(types.BaseTuple.from_types(members, by_value.instance_class))  # type: ignore[attr-defined]
    return types.unliteral(by_value)


def by_reference(cls: type) -> type:
    """Make compiled functions get this class of named tuples as a pointer.

    They read its fields by name alone, and change its arrays in place. A tuple that they build themselves is by value until
    `refer_to` is called on it.
    """
    _BY_REFERENCE.add(cls)

    @typeof_impl.register(cls)
    def type_of(value: Any, c: Any) -> Any:
        return reference_type(types.BaseTuple.from_types([typeof_impl(v, c) for v in value], cls))

    return cls


def _fields(context: Any, builder: Any, typ: Reference, pointer: Any) -> Any:
    """Return what reads and sets the fields behind a pointer in the emitted code."""
    kind = typ.get_data_type()
    memory = context.nrt.meminfo_data(builder, context.make_helper(builder, typ, pointer).meminfo)
    return context.make_helper(builder, kind, ref=builder.bitcast(memory, context.get_value_type(kind).as_pointer()))


def _stored(context: Any, builder: Any, by_value: Any, value: Any) -> Any:
    """Emit code that stores a tuple's fields in new memory. Return the pointer."""
    target = reference_type(by_value)
    size = context.get_constant(types.uintp, context.get_abi_sizeof(context.get_value_type(target.get_data_type())))
    helper = context.make_helper(builder, target)
    helper.meminfo = context.nrt.meminfo_alloc_dtor(builder, size, imp_dtor(context, builder.module, target))
    pointer = helper._getvalue()
    fields = _fields(context, builder, target, pointer)
    for i, (name, field) in enumerate(zip(by_value.fields, by_value, strict=True)):
        member = builder.extract_value(value, i)
        stored = reference_type(field)
        if isinstance(stored, Reference) and not isinstance(field, Reference):
            member = _stored(context, builder, field, member)
        else:
            member = context.cast(builder, member, field, stored)
            context.nrt.incref(builder, stored, member)
        setattr(fields, name, member)
    return pointer


def _refer_to(_context: Any, value: Any) -> Any:
    """Return a pointer to a copy of a tuple of a `by_reference` class and of those in it; for compiled code."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _stored(context, builder, value, args[0])

    return reference_type(value)(value), codegen


refer_to: Any = intrinsic(_refer_to)  # called with the value alone


@unbox(Reference)
def _unbox(typ: Any, obj: Any, c: Any) -> Any:
    native = c.unbox(typ.by_value, obj)
    failed, pointer = c.pyapi.call_jit_code(lambda value: refer_to(value), typ(typ.by_value), [native.value])
    c.context.nrt.decref(c.builder, typ.by_value, native.value)
    return NativeValue(pointer, is_error=c.builder.or_(native.is_error, failed), cleanup=native.cleanup)


def _loaded(context: Any, builder: Any, by_value: Any, pointer: Any) -> Any:
    """Emit code that gathers the fields behind a pointer. Return the tuple by value."""
    fields = _fields(context, builder, reference_type(by_value), pointer)
    members = []
    for name, field in zip(by_value.fields, by_value, strict=True):
        member = getattr(fields, name)
        members.append(_loaded(context, builder, field, member) if isinstance(reference_type(field), Reference) else member)
    return context.make_tuple(builder, by_value, members)


@box(Reference)
def _box(typ: Any, value: Any, c: Any) -> Any:
    by_value = _loaded(c.context, c.builder, typ.by_value, value)
    c.context.nrt.incref(c.builder, typ.by_value, by_value)
    boxed = c.box(typ.by_value, by_value)
    c.context.nrt.decref(c.builder, typ, value)
    return boxed
