within WheelsetRig.Tests;
model LiftedWheelCarriesNoForce "A wheel thrown off the roller carries neither load nor creep force"
  Reference rig(
    pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0, omegaR(start=20.0),
    wheelset(v(start={0.0, 0.0, 0.5}), r(start={0.0, 0.0, 0.005})));
equation
  assert(rig.FzL >= 0.0 and rig.FzR >= 0.0, "A wheel load pulls");
  // 5 mm above the roller: the contact keeps mu*QMin = 0.4 N per wheel at most.
  assert(time > 0.001 or abs(rig.Fx) < 1.0, "A lifted wheel transmits creep force");
  assert(abs(rig.FxL) <= 0.4*(rig.FzL + 1.0), "Creep force exceeds friction");
  annotation (experiment(StopTime=0.5, Tolerance=1e-8));
end LiftedWheelCarriesNoForce;
