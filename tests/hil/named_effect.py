#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether a diagnosis (JSON) names one effect only, and the one that is described: named_effect.py FILE DESCRIPTION"""
import json, sys
found = json.load(open(sys.argv[1]))["effects"]
wanted = json.loads(sys.argv[2])
fine = len(found) == 1 and all(found[0].get(key) == value for key, value in wanted.items())
print("ok:" if fine else "FAILED:", "named", [{k: e.get(k) for k in wanted} for e in found])
sys.exit(not fine)
