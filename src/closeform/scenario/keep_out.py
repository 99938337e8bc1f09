"""Table `keep_out`: the keep-out zone around a craft."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from closeform.arrays import Floats
from closeform.scenario.quantity import AREA, LENGTH, Reader
from closeform.scenario.table import Length, Lengths, Six, Table, Vector
from closeform.zones.combined_zones import Body, CovarianceZone, OwnZone
from closeform.zones.solids import Box, Cylinder, Ellipsoid, HalfSpaces, Sphere
from closeform.zones.zone import Zone

SHAPES = "sphere", "box", "ellipsoid", "covariance", "cylinder", "half_spaces"
Row = Annotated[Vector, Field(strict=False)]


class KeepOut(Table):
    """Table `keep_out`: the zone around a craft that no other may enter."""

    kind: Literal["region", "covariance", "body"] | None = Field(None, examples=['"body"'])
    sphere: Length | None = Field(None, examples=['"20 m"'])
    box: Lengths | None = Field(None, examples=['"20 40 20 m"'])
    ellipsoid: Lengths | None = Field(None, examples=['"20 40 20 m"'])
    covariance: Annotated[Six, BeforeValidator(Reader(AREA, 6))] | None = Field(
        None, examples=['"25 0 100 0 0 25 m^2"']
    )
    sigmas: Annotated[float, Field(gt=0)] | None = Field(None, examples=["3.0"])
    axes: Annotated[tuple[Row, Row, Row], Field(strict=False)] | None = Field(
        None, examples=["[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"]
    )
    cylinder: Annotated[tuple[float, float], BeforeValidator(Reader(LENGTH, 2, "positive"))] | None = Field(
        None, examples=['"10 100 m"']
    )
    axis: Row | None = Field(None, examples=["[0, 1, 0]"])
    half_spaces: Annotated[tuple[float, ...], BeforeValidator(Reader(LENGTH, 0, "positive"))] | None = Field(
        None, examples=['"50 m"']
    )
    normals: Annotated[tuple[Row, ...], Field(strict=False)] | None = Field(None, examples=["[[1, 0, 0]]"])

    def flaws(self) -> Iterator[str]:
        yield from self.only_with("sigmas", "covariance")
        yield from self.only_with("axes", "box", "ellipsoid")
        yield from self.only_with("axis", "cylinder")
        yield from self.only_with("normals", "half_spaces")
        yield from self.one_of(*SHAPES)
        for shape, key in (("covariance", "sigmas"), ("cylinder", "axis"), ("half_spaces", "normals")):
            if getattr(self, shape) is not None and getattr(self, key) is None:
                yield f"{shape} needs {key}; add for example {key} = {self.examples()[key]}"
        rows = np.array(self.axes or np.eye(3))
        if not np.allclose(rows @ rows.T, np.eye(3), atol=1e-9):
            yield "axes are not orthonormal; give three perpendicular rows of length 1"
        if self.axis is not None and not any(self.axis):
            yield "axis is zero; give the cylinder's direction, for example axis = [0, 1, 0]"
        if self.normals is not None and not all(map(any, self.normals)):
            yield "normals: a row is zero; give the direction out of each face"
        if self.half_spaces and self.normals and len(self.normals) != len(self.half_spaces):
            yield (
                f"normals: {len(self.normals)} rows for {len(self.half_spaces)} half_spaces; "
                "give one for each"
            )
        if self.covariance is not None and np.linalg.eigvalsh(self.covariance_matrix())[0] <= 0.0:
            yield "covariance is not positive definite; check its six numbers: rr tr tt nr nt nn"
        if (self.kind == "covariance") > (self.covariance is not None):
            yield 'kind = "covariance" goes with covariance only; write "region" or "body"'
        if self.kind == "body" and self.covariance is not None:
            yield "covariance is of where a craft is, not of its body; remove kind"

    def covariance_matrix(self) -> Floats:
        """Return the covariance (3, 3) in m^2 from its lower triangle by rows, as in a CCSDS CDM."""
        matrix = np.zeros((3, 3))
        matrix[np.tril_indices(3)] = self.covariance
        return np.asarray(matrix + np.tril(matrix, -1).T)

    @property
    def of_errors(self) -> bool:
        """True if the zone is a position uncertainty."""
        return self.covariance is not None and self.kind != "region"

    def own(self) -> OwnZone:
        """Return the craft's own zone: a region, a body or a position uncertainty."""
        if self.of_errors:
            return CovarianceZone(self.covariance_matrix(), self.sigmas or 0.0)
        return Body(self.zone()) if self.kind == "body" else self.zone()

    def zone(self) -> Zone:
        """Return the set of positions that the table describes."""
        if self.sphere is not None:
            return Sphere(self.sphere)
        if self.box is not None:
            return Box(self.box, self.axes)
        if self.ellipsoid is not None:
            return Ellipsoid(self.ellipsoid, self.axes)
        if self.cylinder is not None and self.axis is not None:
            return Cylinder(*self.cylinder, self.axis)
        if self.half_spaces is not None and self.normals is not None:
            return HalfSpaces(self.normals, self.half_spaces)
        return Ellipsoid.from_covariance(self.covariance_matrix(), self.sigmas or 0.0)
