"""Controllers plan the steps of the legs: `protocol` defines their interface, `registry` loads them by name.

A controller of your own is a frozen dataclass with a `name` and a method `begin`; `stepwise` makes its plan from a
function of one step.
"""

from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed
from hexmj.controllers.stepwise import Step, stepwise

__all__ = ["Controller", "FeedbackPlan", "Plan", "Sensed", "Step", "stepwise"]
