"""What is wrong with a record, or with a result.

`inspection`     a record before anything is inferred from it
`suspicions`     units and signs of a record
`record_check`   whether a record fits the model with which its contour was inferred
`verdicts`       what a result says of its own assumptions
"""
