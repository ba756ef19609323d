"""Correlations of the errors of fitted parameters, as `twin.toml` keeps them beside the standard errors."""

from collections.abc import Collection, Sequence

import numpy as np
import tomli_w
from pydantic import Field

from twin.foundation.errors import did_you_mean, short_repr
from twin.foundation.file_schema import TableSchema

CORRELATION_DIGITS = 4  # after the point; errors are not known to a per cent
ROUNDING = 1e-3  # allowed difference of a pair's two entries, and of a diagonal from one


class CorrelationTable(TableSchema):
    """The table `[correlation]`."""

    parameters: list[str] = Field(description="parameters of the robot, and as EFFECT.PARAMETER of effects")
    matrix: list[list[float]] = Field(description="correlation of their errors, a row a parameter")

    @classmethod
    def of(cls, names: Sequence[str], matrix: np.ndarray) -> "CorrelationTable | None":
        """Return the table of a correlation (p, p), or None without parameters or where it is not finite."""
        if not names or not np.isfinite(matrix).all():
            return None
        rounded = np.round(np.clip(matrix, -1.0, 1.0), CORRELATION_DIGITS) + 0.0  # no minus zero
        return cls(parameters=list(names), matrix=rounded.tolist())

    def pairs(self) -> dict[tuple[str, str], float]:
        """Return the correlation of each pair."""
        names = self.parameters
        return {(a, b): x for a, row in zip(names, self.matrix, strict=True) for b, x in zip(names, row, strict=True)}

    def faults(self, known: Collection[str]) -> list[str]:
        """Return what is wrong with it, one text a fault; `known` are the names it may have."""
        names, n = self.parameters, len(self.parameters)
        unknown = [name for name in names if name not in known]
        found = [f"correlation: unknown parameter {short_repr(name)}{did_you_mean(name, known)}" for name in unknown]
        if len(set(names)) < n:
            found.append("correlation: parameters names one twice; each may stand there once")
        if [len(row) for row in self.matrix] != [n] * n:
            sizes = ", ".join(str(len(row)) for row in self.matrix)
            return [*found, f"correlation: matrix has rows of {sizes or 'nothing'}; {n} rows of {n} are needed, as parameters"]
        matrix = np.array(self.matrix)
        if np.abs(matrix).max(initial=0.0) > 1.0 or np.abs(np.diag(matrix) - 1.0).max(initial=0.0) > ROUNDING:
            found.append("correlation: matrix has numbers beyond [-1, 1], or another than 1 on its diagonal; leave the table out")
        elif np.abs(matrix - matrix.T).max(initial=0.0) > ROUNDING:
            found.append("correlation: matrix is not symmetric; a pair's two entries must be equal, or leave the table out")
        return found

    def text(self) -> str:
        """Return the table as TOML, a row of the matrix a line."""
        rows = "".join(f"    {row},\n" for row in self.matrix)
        return tomli_w.dumps({"correlation": {"parameters": self.parameters}}) + f"matrix = [\n{rows}]\n"
