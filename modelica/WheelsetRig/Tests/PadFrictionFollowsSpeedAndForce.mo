within WheelsetRig.Tests;
model PadFrictionFollowsSpeedAndForce "Laws of speed and force at the points that define them"
  Units.Velocity v = -15.0*time "Sliding velocity, in reverse";
  Units.Force F = 50000.0*time "Normal force";
  Effects.SpeedDependentPadFriction speed(level=0.30, Fperp=F, v=v, slope=0.2, vRef=10.0);
  Effects.SpeedDependentPadFriction atReference(
    level=0.30, Fperp=F, v=22.0*0.30/0.46, slope=0.2);
  Effects.PressureDependentPadFriction force(level=0.30, Fperp=F, v=v, exponent=0.04);
  Effects.PressureDependentPadFriction twice(level=0.30, Fperp=2.0*F, v=v, exponent=0.04);
  Effects.PressureDependentPadFriction atRest(level=0.30, Fperp=0.0, v=v, exponent=0.04);
equation
  // 1e-12: rounding.
  assert(abs(atReference.mu - 0.30) < 1e-12, "22 m/s is not the reference");
  assert(abs(speed.mu - (0.36 - 0.06*1.5*time)) < 1e-12, "Not linear from 0.36 to 0.30 at vRef");
  assert(time < 0.02 or abs(twice.mu - force.mu*0.5^0.04) < 1e-12, "Not a power of the force");
  assert(abs(atRest.mu - 0.30*35.0^0.04) < 1e-12, "Below 1 kN the friction is not that at 1 kN");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end PadFrictionFollowsSpeedAndForce;
