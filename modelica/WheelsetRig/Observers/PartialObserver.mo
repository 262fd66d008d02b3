within WheelsetRig.Observers;
partial model PartialObserver "What every observer takes, gives and weighs its feedback with"
  parameter Real samplePeriod(unit="s", min=1e-6) = 0.005 "Time from sample to sample; an exported FMU takes its communication step";
  parameter Units.AngularAcceleration effect_muWR(start=50.0)
    "Effect of muWR on der(omegaW) from which on it has full authority, other than zero";
  parameter Units.AngularAcceleration effect_muDC(start=-100.0)
    "Effect of muDC on der(omegaW) from which on it has full authority, other than zero";
  parameter Units.Velocity fadingHalf(min=1e-6) = 0.5
    "Rolling velocity at which feedback is down to half";

  input Units.Pressure pB "Brake cylinder pressure, measured";
  input Units.Torque tauR "Torque of the drive on the roller, measured";
  input Units.AngularVelocity omegaW "Angular velocity of the wheelset, measured";
  input Units.AngularVelocity omegaR "Angular velocity of the roller, measured";

  output Units.Force Fx "Longitudinal creep force of both wheels, estimated";
  output Units.Velocity slip "Slip velocity, estimated";
  output Units.AngularVelocity omegaWEstimate "Angular velocity of the wheelset, estimated";
  output Units.AngularVelocity omegaREstimate "Angular velocity of the roller, estimated";

protected
  Units.AngularVelocity dy[2] "Measured minus estimated speeds";
  Units.AngularAcceleration actualWR "Effect of muWR on der(omegaW)";
  Units.AngularAcceleration actualDC "Effect of muDC on der(omegaW)";
  Units.Velocity v "Rolling velocity, measured";
  Real fade(unit="1") "Share of the feedback: none at rest, all of it at speed";
  Sampled authorityWR(
    value=noEvent(max(-1.0, min(1.0, actualWR/effect_muWR))), period=samplePeriod);
  Sampled authorityDC(
    value=noEvent(max(-1.0, min(1.0, actualDC/effect_muDC))), period=samplePeriod);
equation
  dy = {omegaW - omegaWEstimate, omegaR - omegaREstimate};
  fade = v^2/(v^2 + fadingHalf^2);
end PartialObserver;
