within TrainRig.Tests;
model SlideProtectionKeepsAxlesTurning "On a slippery rail an axle locks without slide protection, and with it does not"
  Real pressure(unit="Pa") = 2.7e5*(1.0 - exp(-time/0.45)) "Behind the valve";
  Parts.Axle bare(v=25.0, Q=61e3, mu0=0.08, p=pressure, protection(on=0.0), omega(start=54.3));
  Parts.Axle axle(v=25.0, Q=61e3, mu0=0.08, p=pressure, omega(start=54.3));
  Parts.Axle dry(v=25.0, Q=61e3, mu0=0.40, p=pressure, omega(start=54.3));
protected
  parameter Real rolling(unit="rad/s") = 25.0/0.46;
equation
  // Pads take 53 rad/s2 at most; while their torque halves by venting (0.14 s), 7 rad/s beyond 12 %.
  assert(axle.omega > 0.88*rolling - 7.5, "The axle locks");
  assert(time < 5.0 or bare.omega < 1.0, "Without slide protection it does not lock");
  assert(time < 2.0 or axle.protection.passed < 0.9, "It turns without venting");
  assert(abs(dry.protection.passed - 1.0) < 1e-12, "It vents on a dry rail");
  annotation (experiment(StopTime=6.0, Tolerance=1e-7));
end SlideProtectionKeepsAxlesTurning;
