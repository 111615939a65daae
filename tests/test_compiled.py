"""Machine code is kept where it can be."""

from sum_drake import compiled


def test_compiled_code_is_not_kept_where_nothing_can_be_written(monkeypatch):
    def refuse(function=None, **options):
        if options.get("cache"):
            return lambda f: (_ for _ in ()).throw(RuntimeError("cannot cache function: no locator available"))
        return function

    monkeypatch.setattr(compiled.numba, "njit", refuse)
    assert compiled.compiled(len) is len
