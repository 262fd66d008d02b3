within WheelsetRig.Tests;
model BalancesHoldTheActualQuantities "Radii, inertia, torque and losses act where the balances have them"
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 0.5))) "Brake pressure";
  MinimalObserver rig(
    muWR=0.40, redeclare Effects.WheelRadius wheelRadius(delta=-0.01),
    redeclare Effects.RollerRadius rollerRadius(delta=0.02),
    redeclare Effects.WheelInertia wheelInertia(gain=0.2),
    redeclare Effects.RollerInertia rollerInertia(gain=0.05),
    redeclare Effects.DriveTorqueGain driveTorque(gain=0.05),
    redeclare Effects.WheelsetLosses wheelsetLoss(gain=1.0),
    redeclare Effects.RollerLosses rollerLoss(gain=0.5), pB=p, tauR=2100.0, dmuWR=0.0,
    dmuDC=0.0, correctionW=2.0, correctionR=3.0,
    omegaW(start=20.0*0.72/0.45), omegaR(start=20.0));
  Units.Torque tauB = 0.9*0.30*0.1086*noEvent(max(0.0, p - 25000.0)) "Torque of the pads";
  output Units.Torque wheelset =
    0.45*rig.Fx - tauB - 2.0*(25.0 + 0.6*rig.omegaW + 0.004*rig.omegaW^2)
    - 132.0*(der(rig.omegaW) - 2.0) "What the balance of the wheelset lacks";
  output Units.Torque roller =
    2000.0 - 0.72*rig.Fx - 1.5*(40.0 + rig.omegaR + 0.02*rig.omegaR^2)
    - 1575.0*(der(rig.omegaR) - 3.0) "What the balance of the roller lacks";
equation
  // 1e-6 of 10 kN.m: rounding.
  assert(abs(wheelset) < 1e-6, "Balance of the wheelset");
  assert(abs(roller) < 1e-6, "Balance of the roller");
  assert(abs(rig.slip - (0.72*rig.omegaR - 0.45*rig.omegaW)) < 1e-12, "Slip");
  annotation (experiment(StopTime=1.0, Tolerance=1e-6));
end BalancesHoldTheActualQuantities;
