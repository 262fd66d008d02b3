within Effects.Tests;
model GasIsChokedBelowTheCriticalRatio "An orifice after ISO 6358"
  Units.Pressure p = 1e5*(0.2 + 0.9*time) "Downstream of 1 bar, up to 1.1 bar";
  Leaks.Orifice hole(p1=1e5, p2=p, C=2e-9, b=0.4);
  Leaks.Orifice back(p1=p, p2=1e5, C=2e-9, b=0.4);
  Leaks.Orifice hot(p1=1e5, p2=p, C=2e-9, b=0.4, T=4.0*293.15);
protected
  Real ratio = p/1e5;
equation
  // 2e-9 m3/(s.Pa) at 1 bar and 1.185 kg/m3.
  assert(ratio > 0.4 or abs(hole.q - 2.37e-4) < 1e-12, "Not choked below the critical ratio");
  // Modelica may evaluate all of a condition: beyond a ratio of 1 there is no root.
  assert(ratio < 0.4 or ratio > 0.95
    or abs(hole.q/2.37e-4 - sqrt(max(0.0, 1.0 - ((ratio - 0.4)/0.6)^2))) < 2e-3,
    "Not an ellipse above it");
  assert(ratio < 1.0001 or hole.q < 0.0, "Does not flow back");
  assert(abs(hole.q + back.q) < 1e-18, "Not the same in the other direction");
  assert(abs(hot.q - 0.5*hole.q) < 1e-15, "Does not fall with the root of the temperature");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end GasIsChokedBelowTheCriticalRatio;
