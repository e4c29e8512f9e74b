"""Why a trial was lost: the record of a trial, its diagnosis, and the diagnosis in words."""
