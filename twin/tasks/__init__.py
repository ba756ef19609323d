"""What a hand is to do with things: one task per file, found by itself; success is defined by where the object is.

task.py   what a task is, how a person pushes, what may become of it     trial.py   one trial, a step at a time
"""

from twin.tasks.task import STEP, TABLE, Outcome, Person, Task, Track, task, tasks
from twin.tasks.trial import Trial

__all__ = ["STEP", "TABLE", "Outcome", "Person", "Task", "Track", "Trial", "task", "tasks"]
