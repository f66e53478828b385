"""Formats that are not read, by the endings of their files, with remedies."""

from __future__ import annotations

_EXPORT = "save the mesh as VTU, Gmsh 4.1 or Abaqus in the program that made it"
_TWO_FILES = "mesh in two files, of which a result could name only one; write it as VTU or Gmsh"
_NO_MESH = "geometry without a mesh; mesh it and save that as VTU, Gmsh 4.1 or STL"
_IMAGE = "image; segment the organ and save its surface as STL or its mesh as VTU"
_PACKED = "packed file; unpack it"
_SURFACE = "surface or a scene; save the surface as STL, OBJ or PLY"
_LIST = "list without a standard; write nodes and elements as Gmsh 2.2 text or Abaqus"

_FORMATS = {
    "Nastran": (
        ".nas .bdf .fem .nastran",
        f"deck, whose coordinate systems are not read; {_EXPORT}",
    ),
    "LS-DYNA": (".k .key .dyn", f"deck; {_EXPORT}"),
    "ANSYS": (".cdb .ans", f"archive; {_EXPORT}"),
    "FEBio": (".feb", f"model; {_EXPORT}"),
    "Exodus": (".e .exo .ex2", f"file; {_EXPORT}"),
    "XDMF": (".xdmf .xmf .hmf .h5 .hdf5", f"file; {_EXPORT}"),
    "MED": (".med .rmed", f"file; {_EXPORT}"),
    "MOAB": (".h5m", f"file; {_EXPORT}"),
    "CGNS": (".cgns", f"file; {_EXPORT}"),
    "Netgen": (".vol", f"mesh; {_EXPORT}"),
    "SU2": (".su2", f"mesh; {_EXPORT}"),
    "UGRID": (".ugrid", f"mesh; {_EXPORT}"),
    "DOLFIN": (".xml", f"mesh; {_EXPORT}"),
    "AVS UCD": (".avs", f"file; {_EXPORT}"),
    "FLAC3D": (".f3grid", f"grid; {_EXPORT}"),
    "Kratos": (".mdpa", f"model; {_EXPORT}"),
    "Permas": (".post .dato", f"file; {_EXPORT}"),
    "Tecplot": (".tec .plt", f"file; {_EXPORT}"),
    "TetGen": (".node .ele .poly .smesh .face", _TWO_FILES),
    "text": (".txt .csv .dat", _LIST),
    "CAD": (".step .stp .iges .igs .brep .geo .sldprt", _NO_MESH),
    "graphics": (".gltf .glb .3mf .fbx .dae .x3d .wrl .blend", _SURFACE),
    "medical": (".nii .nrrd .nhdr .mha .mhd .dcm .img", _IMAGE),
    "archive": (".gz .zip .bz2 .xz .7z", _PACKED),
}
_BY_ENDING = {
    ending: f"{name} {remedy}"
    for name, (endings, remedy) in _FORMATS.items()
    for ending in endings.split()
}


def refusal(ending: str, read: str) -> str:
    """Why a file with this ending (`.nas`) is not read, what is read, and the remedy."""
    known = f" ({ending} is for: {_BY_ENDING[ending]})" if ending in _BY_ENDING else ""
    return f"unknown file name ending `{ending}`; can be read: {read}{known}"


def named() -> dict[str, str]:
    """Names of the formats that are known but not read, and the first of their endings."""
    return {name: endings.split()[0] for name, (endings, _) in _FORMATS.items()}
