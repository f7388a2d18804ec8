"""Secrets, codes and statistics: what is hidden, and how surely it was read. No mesh here.

keys        the owner's secret             -> portable pseudo-random streams
scs         values, bits, a dither         -> codewords of the scalar Costa scheme
payload     a message                      -> bits, and back from soft bits
detection   soft bits, the bits expected   -> a p-value
"""
