"""The page on which learners can be watched."""
