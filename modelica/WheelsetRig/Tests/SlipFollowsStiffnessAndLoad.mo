within WheelsetRig.Tests;
model SlipFollowsStiffnessAndLoad "At small slip: in proportion to 1/stiffness and to load^(-2/3)"
  MinimalObserver nominal(
    muWR=0.40, pB=45000.0, tauR=700.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.6999/0.46), omegaR(start=20.0));
  MinimalObserver soft(
    redeclare Effects.CreepStiffness creepStiffness(gain=-0.5),
    muWR=0.40, pB=45000.0, tauR=700.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.6999/0.46), omegaR(start=20.0));
  MinimalObserver heavy(
    redeclare Effects.WheelLoad wheelLoad(gain=0.2),
    muWR=0.40, pB=45000.0, tauR=700.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.6999/0.46), omegaR(start=20.0));
  output Real softer(unit="1") = soft.slip*nominal.Fx/(nominal.slip*soft.Fx) "Ratio of slip";
  output Real heavier(unit="1") = heavy.slip*nominal.Fx/(nominal.slip*heavy.Fx) "Ratio of slip";
equation
  // 0.3 %: the curve bends by (2/3)*eps^2, eps = 0.03; it falls with slip velocity by 0.3 %.
  assert(time < 0.1 or abs(softer - 2.0) < 0.006, "Half the stiffness");
  assert(time < 0.1 or abs(heavier - 1.2^(-2.0/3.0)) < 0.003, "A load of 120 %");
  annotation (experiment(StopTime=0.5, Tolerance=1e-8));
end SlipFollowsStiffnessAndLoad;
