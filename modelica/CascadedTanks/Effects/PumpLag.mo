within CascadedTanks.Effects;
model PumpLag "flow of the pump that lags behind its voltage"
  extends Slots.PartialSignal;
  parameter Real lag(unit="s", min=0.0, max=60.0) = 0.0 "Time constant";
  Real past(unit="V", start=3.0, fixed=true) "Voltage, smoothed";
protected
  Real T(unit="s") = sqrt(lag^2 + 1.0) "Time constant of the smoothing";
equation
  T*der(past) = u - past;
  y = u - lag*der(past);
  annotation (
    __Workbench(effect(
      size="lag", step=1.0, matters=2.0,
      slots={"drive"},
      separation="a step of the voltage, with the flow watched")),
    Documentation(info="<html>
<p>First order: inertia of motor and water, and the way of the water to the tank. <code>T^2 = lag^2 + (1
s)^2</code>: nothing at a lag of zero.</p>
</html>"));
end PumpLag;
