within WheelsetRig.Tests;
model PolachSlopeIsKalkerStiffness "With kA = kS = 1 the creep force starts with slope K per creepage"
  parameter Units.Force Q = 80000.0 "Wheel load";
  parameter Units.Velocity v = 20.0 "Rolling velocity";
  parameter Units.Velocity w = 1e-5 "Slip velocity, far below saturation";
  parameter Contact.PolachParameters polach(kA=1.0, kS=1.0);
  Units.Force K = Contact.kalkerStiffness(Q);
  output Real ratio(unit="1") = Contact.creepForce(w, v, Q, K, 0.4, polach, 0.0)*v/w/K
    "Slope over Kalker's";
equation
  // The law deviates by (2/3)*eps^2; eps = pi*K*w/(4*Q*mu*v) = 1.2e-4 here.
  assert(abs(ratio - 1.0) < 1e-7, "Polach's slope at zero slip differs from K");
end PolachSlopeIsKalkerStiffness;
