#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial.md word for word: every command of it in order, each must print what stands there, and every figure of the
text in mm must be one of those that were printed. What it makes stays in build/…/tutorial; docs/pictures/make draws that."""
import glob, os, re, shown, shutil, sys
root, programs = os.environ["FLEXCOMP_SOURCE_DIR"], os.environ["FLEXCOMP_BIN_DIR"]
work = os.path.join(os.path.dirname(programs), "tutorial")
shutil.rmtree(work, ignore_errors=True)
os.makedirs(work)
shown.stand_in(work, root, programs)
text = open(root + "/docs/tutorial.md", encoding="utf-8").read()
failed, printed = shown.run(text, least=15)

# What is printed, and what stands in the files that the tutorial starts from.
known = printed + "".join(open(f).read() for f in [root + "/host/robots/tx60l.yaml"] + glob.glob(root + "/docs/examples/*.yaml"))
numbers = [float(n) for n in re.findall(r"(?<![\w.])-?\d+\.\d+", known)]
prose = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
figures = re.findall(r"(\d+\.(\d+))(?: mm| and \d+\.\d+ mm| arcsec)", prose)
if len(figures) < 3: sys.exit("the text has only %d figures: is it still read rightly?" % len(figures))
for figure, decimals in figures:
    if not any("%.*f" % (len(decimals), abs(n)) == figure for n in numbers):
        failed = True
        print("FAILED: %s is in the text and was not printed" % figure)
failed |= shown.links(text, root + "/docs")
sys.exit(failed)
