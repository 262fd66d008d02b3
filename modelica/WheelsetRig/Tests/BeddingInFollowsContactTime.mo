within WheelsetRig.Tests;
model BeddingInFollowsContactTime "Pads bed in while they touch, at any force and speed"
  Units.Force F = 10000.0*(1.0 + tanh(400.0*(time - 1.0))) "Normal force, from 1 s on";
  Effects.BeddingIn bedding(level=0.30, Fperp=F, v=20.0, loss=0.1, tau=2.0);
  Effects.BeddingIn light(level=0.30, Fperp=0.2*F, v=-1.0, loss=0.1, tau=2.0);
  Effects.BeddingIn apart(level=0.30, Fperp=0.0, v=20.0, loss=0.1, tau=2.0);
  Units.FrictionCoefficient expected = 0.30*(1.0 - 0.1*exp(-(time - 1.0)/2.0));
equation
  // Contact begins up to 0.02 s before 1 s, while the force rises: 1 % of the deficit of 0.03.
  assert(time < 1.0 or abs(bedding.mu - expected) < 3e-4, "Deficit after first contact");
  assert(time < 1.0 or abs(light.mu - expected) < 3e-4, "Deficit at low force, in reverse");
  assert(time > 0.9 or abs(bedding.mu - 0.27) < 1e-5, "Bedding in before contact");
  // 1e-7: ten times the solver's tolerance.
  assert(abs(apart.mu - 0.27) < 1e-7, "Bedding in without contact");
  annotation (experiment(StopTime=6.0, Tolerance=1e-8));
end BeddingInFollowsContactTime;
