"""Logs of real surveys: read, projected to metres, put in order."""

from infoplan.survey.log import SurveyLog, read_log

__all__ = ["SurveyLog", "read_log"]
