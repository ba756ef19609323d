"""Tasks of the hand: one a module, found by its file's name; success is defined by where the object is.

task.py      base of all tasks, a person's push, outcomes        trial.py     one trial, step by step imitation/   demonstrations,
policies and trials by tendons
"""

from twin.tasks.task import CONTROL_STEP, TABLE_NAME, Demonstrator, ObjectTrack, Outcome, Task, make_task, tasks
from twin.tasks.trial import TaskTrial

__all__ = ["CONTROL_STEP", "TABLE_NAME", "Demonstrator", "ObjectTrack", "Outcome", "Task", "TaskTrial", "make_task", "tasks"]
