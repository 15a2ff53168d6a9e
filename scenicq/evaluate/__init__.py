"""A model judged on the frames that match: does what failed in simulation fail in reality, too?"""
