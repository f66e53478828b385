"""Results of a study, on disk and in memory.

>>> results = Results.load("results/block")
>>> motion = results.curve("msm-mamdani", "tool")
>>> plt.plot(motion.time, motion.displacement)
"""

from study.results.folder import Results, ResultsError
from study.results.records import ModelRecord, StudyRecord

__all__ = ["ModelRecord", "Results", "ResultsError", "StudyRecord"]
