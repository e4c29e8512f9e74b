"""Why a trial was lost: what is recorded of it, what is found in that, and the words for it."""
