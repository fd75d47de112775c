"""Reads .vtu or .pvd files back with VTK and checks what is in them.

    python read_vtu.py FILE POINTS [ARRAY ...]

FILE is a .vtu, or a .pvd, of which every frame is read. Each must open without
a word from VTK, have POINTS points, as many cells, each a vertex on its own
point, every ARRAY with one tuple per point, and only finite numbers. Exit code
1, with words, where one does not.
"""

import math
import os
import sys
import xml.etree.ElementTree as ElementTree

import vtk

VERTEX = 1


def frames(path):
    """The .vtu files of a path, each with the time its series gives (or None)."""
    if not path.endswith(".pvd"):
        return [(path, None)]
    folder = os.path.dirname(path)
    sets = ElementTree.parse(path).getroot().iter("DataSet")
    return [(os.path.join(folder, s.get("file")), float(s.get("timestep"))) for s in sets]


def numbers_are_finite(array):
    # Not GetFiniteRange: it skips what is looked for here.
    numbers = memoryview(array)
    return all(map(math.isfinite, numbers.cast("B").cast(numbers.format)))


def faults(path, time, count, names):
    """What is wrong with one .vtu, in words."""
    if not os.path.isfile(path):
        return ["no such file"]
    said = []
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.AddObserver("ErrorEvent", lambda *_: said.append("VTK reports an error"))
    reader.AddObserver("WarningEvent", lambda *_: said.append("VTK reports a warning"))
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    if said:
        return said
    if grid.GetNumberOfPoints() != count:
        said.append(f"{grid.GetNumberOfPoints()} points, expected {count}")
    if grid.GetNumberOfCells() != grid.GetNumberOfPoints():
        said.append(f"{grid.GetNumberOfCells()} cells for {grid.GetNumberOfPoints()} points")
    for i in sorted({0, grid.GetNumberOfCells() // 2, grid.GetNumberOfCells() - 1}):
        if 0 <= i < grid.GetNumberOfCells():
            cell = grid.GetCell(i)
            if cell.GetCellType() != VERTEX or cell.GetPointId(0) != i:
                said.append(f"cell {i} is not a vertex on point {i}")
    if count and not numbers_are_finite(grid.GetPoints().GetData()):
        said.append("points are not all finite")
    data = grid.GetPointData()
    for name in names:
        array = data.GetArray(name)
        if array is None:
            present = [data.GetArrayName(i) for i in range(data.GetNumberOfArrays())]
            said.append(f"no array `{name}`, only {present}")
        elif array.GetNumberOfTuples() != count:
            said.append(f"`{name}` has {array.GetNumberOfTuples()} tuples")
        elif not numbers_are_finite(array):
            said.append(f"`{name}` is not finite everywhere")
    stored = grid.GetFieldData().GetArray("TimeValue")
    if stored is None:
        said.append("no TimeValue")
    elif time is not None and stored.GetValue(0) != time:
        said.append(f"TimeValue {stored.GetValue(0)} but the series says {time}")
    return said


def main(arguments):
    if len(arguments) < 2 or not arguments[1].isdigit():
        print(__doc__)
        return 1
    path, count, names = arguments[0], int(arguments[1]), arguments[2:]
    if not os.path.isfile(path):
        print(f"{path}: no such file")
        return 1
    listed = frames(path)
    if not listed:
        print(f"{path}: lists no frames")
        return 1
    wrong = 0
    for file, time in listed:
        for fault in faults(file, time, count, names):
            print(f"{file}: {fault}")
            wrong += 1
    if not wrong:
        print(f"{path}: {len(listed)} frame(s), {count} points, {len(names)} array(s): right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
