"""`python -m closeform` is the command line."""

import sys

from closeform.cli import main

sys.exit(main())
