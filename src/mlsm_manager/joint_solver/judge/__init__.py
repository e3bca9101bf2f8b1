"""Do scans and map agree, and what does the solver not know of its own errors?"""
