"""Recompute stored missions from their tables with PyOD, scikit-learn and SciPy.

The audit reads what a stranger could read, the Parquet tables and the YAML of a run, and works
every number out again in its own slow and plain way. It shares no code with the mission: an error
made there cannot repeat itself here.
"""

from infoplan.analyse.audit.findings import Finding, audit, audit_mission

__all__ = ["Finding", "audit", "audit_mission"]
