"""The differences between two fuzzy controllers: variables, terms, rules, and outputs."""

from fis_tools.findings.difference.comparison import SystemDifference
from fis_tools.findings.difference.report import Difference, difference

__all__ = ["Difference", "SystemDifference", "difference"]
