"""What a volume term costs and brings: two lattices against finite elements, each timed."""

import time

from study.models.table import model
from study.scene.file import read_scene
from study.scene.problem import problem_of
from study.similarity.fields import relative_l2

scene = read_scene("block", ["reference.element_size=20 mm", "time.duration=1 s"])
problem = problem_of(scene)
volumes = problem.volume_rule.weights
truth = model(scene, "fem").prepare(problem).rest()
tissue = model(scene, "tissue")

errors = {}
for name, volume_term in (("springs alone", False), ("with volume term", True)):
    lattice = tissue.varied(spacing=0.01, volume_term=volume_term).prepare(problem)
    errors[name] = relative_l2(lattice.rest(), truth, volumes)
    stepper = lattice.stepper()
    stepper.take_bare_steps(100)  # compiled, and warm
    started = time.perf_counter()
    stepper.take_bare_steps(1000)
    wall = (time.perf_counter() - started) / 1000 / stepper.step
    print(f"{name}: field error at rest {100 * errors[name]:.1f} %, {wall:.3f} s per second")
answer = errors["with volume term"]
