"""Commands of words on top of Click.

A `infoplan.command_line.settings.Setting` declares an option; Click's own options are the flags.
Parsing, help, completion and suggestions all read the same declarations.
"""
