"""Results of a study, on disk and in memory.

>>> results = Results.load("results/block")
>>> motion = results.curve("msm-mamdani", "tool")
>>> plt.plot(motion.time, motion.displacement)
"""

from study.results.errors import ResultsError
from study.results.records import ModelRecord, StudyRecord
from study.results.results import Results

__all__ = ["ModelRecord", "Results", "ResultsError", "StudyRecord"]
