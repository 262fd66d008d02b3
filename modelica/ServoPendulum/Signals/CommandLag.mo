within ServoPendulum.Signals;
model CommandLag "A goal that the controller follows late"
  extends Common.Signals.Lag(lag(max=0.1));
  annotation (
    __Workbench(effect(
      size="lag", matters=1e-3, slots={"command"},
      separation="steps of the goal, with the duty recorded")),
    Documentation(info="<html>
<p>Of the bus, of the loop that sends goals, or of a profile generator in the servo.</p>
</html>"));
end CommandLag;
