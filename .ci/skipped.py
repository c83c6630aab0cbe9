"""Print the tests that a run skipped for want of robots, from its report in the form of JUnit."""

import sys
from xml.etree import ElementTree

for case in ElementTree.parse(sys.argv[1]).iter("testcase"):
    skipped = case.find("skipped")
    if skipped is not None and "robots" in skipped.get("message", ""):
        print(f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}")
