"""Long runs that no test suite has the time for; each is started by hand, and says what it found.

- python -m tests.endurance.kills --count 100  kills at random moments, and the same command again
- python -m tests.endurance.ctrl_c --moments 20  how soon the prompt is back, and what is left
- python -m tests.endurance.full_disk            one line, and on once there is space (as root)
- python -m tests.endurance.million              random steps, bang-bang, drops and spins
- python -m tests.endurance.backends             local, joblib and Ray with 1, 2 and 3 processes

All end with exit code 1 if a bar is missed.
"""
