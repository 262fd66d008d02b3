within CascadedTanks.Effects;
model SensorLag "a level sensor that lags behind"
  extends Slots.PartialSignal;
  parameter Real lag(unit="s", min=0.0, max=60.0) = 0.0 "Time constant";
  Real past(unit="V", start=5.0, fixed=true) "Level, smoothed";
protected
  Real T(unit="s") = sqrt(lag^2 + 1.0) "Time constant of the smoothing";
equation
  T*der(past) = u - past;
  y = u - lag*der(past);
  annotation (
    __Workbench(effect(
      size="lag", step=1.0, matters=2.0,
      slots={"sensor"},
      separation="the reading while the tank is emptied at once")),
    Documentation(info="<html>
<p>First order, as <code>PumpLag</code>.</p>
</html>"));
end SensorLag;
