"""How deep a tool goes into a block of springs of 4 kPa within a second."""

import msm
from study.scene.file import read_scene
from study.scene.problem import problem_of

problem = problem_of(read_scene("block", ["time.duration=1 s", "tool.history.kind=step"]))
body = msm.assemble(
    problem.geometry.body,
    problem.surface_rule,
    1060.0,  # density [kg/m^3]
    0.01,  # spacing [m]
    problem.foundation,
    problem.tool,
)
springs = msm.Hooke(msm.calibration.reference_stiffness(4e3, 0.01))
material = msm.Material(springs, damping=msm.NodalDamping(30.0))
found = msm.run(body, material, problem.factor, problem.observation)

tool = problem.probes.index("tool")
depth = found.trajectory.displacement[-1, tool] @ problem.tool.direction
answer = 1e3 * depth
print(f"{found.steps} steps, critical step {1e3 * found.critical_time_step:.2f} ms")
print(f"the tool is {answer:.3f} mm deep")
