"""What laws are given - named tuples of arrays and numbers - goes from one to the next by address.

numba hands a named tuple on as the words that all its arrays are made of, some hundred at each
call, which took longer to compile than what laws do. Here it is written down once, where Python
calls, and a law reads the arrays that it names. Tuples never change, only what is in their arrays.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_cast,
    lower_getattr_generic,
    models,
    overload,
    register_model,
)


class Bundle(types.Type):  # type: ignore[misc]
    """Address of a tuple.

    Parameters
    ----------
    content : type of the tuple.
    """

    def __init__(self, content: types.BaseTuple) -> None:
        self.content = content
        super().__init__(f"Bundle({content})")

    @property
    def key(self) -> types.Type:
        """What tells it from others: classes of one name may have other fields."""
        return self.content


def handed(kind: types.Type) -> types.Type:
    """Type of what a law is given, by that of the value: named tuples and tuples of these."""
    return Bundle(kind) if _is_named(kind) else kind


def _is_named(kind: types.Type) -> bool:
    if isinstance(kind, types.BaseNamedTuple):
        return True
    return isinstance(kind, types.BaseTuple) and any(_is_named(one) for one in kind.types)


@register_model(Bundle)
class _Address(models.PrimitiveModel):  # type: ignore[misc]
    """A pointer."""

    def __init__(self, manager: Any, kind: Bundle) -> None:
        place = manager.lookup(kind.content).get_data_type().as_pointer()
        super().__init__(manager, kind, place)


@lower_cast(types.BaseTuple, Bundle)  # type: ignore[untyped-decorator]
def _write_down(context: Any, builder: Any, kind: Any, bundle: Bundle, value: Any) -> Any:
    """Address of a tuple on the stack of who hands it on."""
    place = cgutils.alloca_once(builder, context.get_data_type(bundle.content))
    _store(context, builder, kind, value, place)
    # What is read by this address never changes (`_words`), which is true from here on only: no
    # instruction, but LLVM moves nothing across it.
    passed = ir.FunctionType(place.type, [place.type])
    return builder.asm(passed, "", "=r,0,~{memory}", [place], side_effect=True)


def _store(context: Any, builder: Any, kind: types.Type, value: Any, place: Any) -> None:
    if isinstance(kind, types.BaseTuple):
        for k, one in enumerate(kind.types):
            at = cgutils.gep_inbounds(builder, place, 0, k)
            _store(context, builder, one, builder.extract_value(value, k), at)
    else:
        builder.store(context.data_model_manager[kind].as_data(builder, value), place)


def _member(context: Any, builder: Any, kind: types.Type, at: Any) -> Any:
    """Member of a tuple at an address: what lies there, or the address if it goes by that."""
    if isinstance(handed(kind), Bundle):
        return at
    value = _words(builder, at)
    if isinstance(kind, types.Array):
        return value
    return context.data_model_manager[kind].from_data(builder, value)


def _words(builder: Any, at: Any) -> Any:
    """What lies at an address, word by word, so that LLVM leaves out what is not used."""
    kind = at.type.pointee
    if not isinstance(kind, ir.Aggregate):
        word = builder.load(at)
        word.set_metadata("invariant.load", builder.module.add_metadata([]))
        return word
    value = ir.Constant(kind, ir.Undefined)
    for k in range(len(kind)):
        part = _words(builder, cgutils.gep_inbounds(builder, at, 0, k))
        value = builder.insert_value(value, part, k)
    return value


@infer_getattr
class _Field(AttributeTemplate):  # type: ignore[misc]
    key = Bundle

    def generic_resolve(self, bundle: Bundle, name: str) -> types.Type | None:
        """Type of a field."""
        content = bundle.content
        if not isinstance(content, types.BaseNamedTuple) or name not in content.fields:
            return None
        return handed(content.types[content.fields.index(name)])


@lower_getattr_generic(Bundle)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, bundle: Bundle, place: Any, name: str) -> Any:
    index = bundle.content.fields.index(name)
    at = cgutils.gep_inbounds(builder, place, 0, index)
    return _member(context, builder, bundle.content.types[index], at)


@intrinsic  # type: ignore[untyped-decorator]
def _item(typing: Any, bundle: Any, index: Any) -> Any:
    """Member of a tuple whose members are of one type, by its number."""
    kind = bundle.content.dtype

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place, number = given
        at = builder.gep(place, [cgutils.intp_t(0), number], inbounds=True)
        return _member(context, builder, kind, at)

    return handed(kind)(bundle, types.intp), generate


@overload(operator.getitem)
def _get_item(bundle, index):  # type: ignore[no-untyped-def]
    if isinstance(bundle, Bundle) and isinstance(bundle.content, types.UniTuple):
        return lambda bundle, index: _item(bundle, index)
    return None
