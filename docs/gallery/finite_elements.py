"""The same block of tissue by quadratic finite elements at rest, on two meshes."""

import fem_reference as fem
from study.scene.file import read_scene
from study.scene.problem import problem_of

problem = problem_of(read_scene("block"))
tool = problem.observation.probes[[problem.tool_probe]]
depths = {}
for k in (-2, 0):
    level = problem.geometry.level(k)
    body = fem.build(level.mesh, problem.tissue, problem.foundation, problem.tool, "p2")
    depths[body.unknowns] = 1e3 * float(fem.static_field(body, tool)[0] @ problem.tool.direction)

for unknowns, depth in depths.items():
    print(f"{unknowns:6d} unknowns: {depth:.3f} mm")
answer = depth
