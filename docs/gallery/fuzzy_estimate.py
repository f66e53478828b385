"""What three fuzzy systems make of one elastography reading of 9.5 kPa in hepatitis C."""

import fuzzy

found = {system: fuzzy.estimate({"hcv": 9.5e3}, system) for system in fuzzy.SYSTEMS}
for system, one in found.items():
    low, high = one.interval or (one.estimate, one.estimate)
    print(f"{system:16s} {one.estimate / 1e3:6.2f} kPa, from {low / 1e3:.2f} to {high / 1e3:.2f}")
answer = found["mamdani"].estimate
