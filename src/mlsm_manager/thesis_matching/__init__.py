"""The scan matching of the thesis and of its 2015 code, to run or to compare with."""
