"""Logs of real surveys: read, projected to metres, put in order."""

from infoplan.survey.log import SurveyLog, read_log
from infoplan.survey.several import read_logs

__all__ = ["SurveyLog", "read_log", "read_logs"]
